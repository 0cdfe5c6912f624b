// Rendered pictures instead of tracks: do the tracks follow points of the world, and are the covariances still what the
// errors are? With siblings: tracks looked for by the turn alone, and pixels trusted too much.
#include <catch2/catch.hpp>
#include <map>
#include <opencv2/core.hpp>

#include "geometry/determinism.h"
#include "msckf/picture_tracks.h"
#include "simulation/scene/film.h"
#include "statistics/consistency.h"
#include "support/visual_drive.h"

using namespace roadfix;

namespace {

constexpr int kDrives = 3;
constexpr int kDegrees = 9;  // position, attitude, velocity at the end
constexpr double kDuration = 25.0;
constexpr int kWidth = 640, kHeight = 192;
constexpr double kFalse_px = 4.0;     // from where the point is: a track of something else
constexpr double kFast = 5.0;         // m/s
constexpr double kFarthest = 200.0;   // m
constexpr double kMostFalse = 0.12;   // share of new tracks; depth edges and moving cars count as false, too
constexpr double kWithoutWay = 0.16;  // at least, where the turn alone says where to look
constexpr double kTooBold = 8.0;

struct Shown {
  int64_t t_us = 0, true_us = 0;
  GrayImage picture;
  std::vector<float> depth;
};

struct Filmed {
  test::VisualDrive drive;
  SimulatedRig rig;
  std::vector<Shown> pictures;
};

Filmed film(const test::VisualDriveConfig& car, uint64_t seed) {
  test::VisualDrive simulated{simulate(car.scenario, seed), {}, {}};
  const SimulatedRig rig = rig_of(simulated.drive);
  Filmed out{std::move(simulated), rig, {}};
  const SimulatedDrive& drive = out.drive.drive;
  InlineExecutor executor;
  Film camera(drive, executor);
  size_t picture = 0;
  while (camera.advance()) {
    while (picture < drive.pictures_left.size() && drive.pictures_left[picture].exposure < camera.taken()) ++picture;
    if (picture >= drive.pictures_left.size() || drive.pictures_left[picture].exposure != camera.taken()) continue;
    out.pictures.push_back({drive.pictures_left[picture].t_us, drive.exposures[camera.taken()],
                            camera.picture(CameraSide::kLeft, {}), camera.light(CameraSide::kLeft).depth});
  }
  return out;
}

/// Where new tracks are one picture later, against where their points are.
struct Matches {
  int all = 0, wrong = 0;
  [[nodiscard]] double share() const { return static_cast<double>(wrong) / all; }
};

class MatchJudge {
 public:
  explicit MatchJudge(const Filmed& filmed) : filmed_(filmed) {}

  void judge(const Shown& shown, const msckf::SeenFrame& frame, Matches& matches) {
    const SE3 T_enu_camera =
        filmed_.drive.drive.kinematics_at(shown.true_us).T_enu_vehicle * filmed_.rig.T_vehicle_left;
    const double speed = filmed_.drive.drive.truth_at(shown.true_us).velocity.x();
    const Camera& lens = filmed_.rig.camera;
    std::map<int64_t, Eigen::Vector3d> born;
    for (const msckf::SeenPoint& point : frame.points) {
      const Eigen::Vector3d ray(point.left.x(), point.left.y(), 1.0);
      const auto seen = lens.project(ray);
      if (!seen) continue;
      const auto before = born_.find(point.track);
      const auto there = before == born_.end() ? std::nullopt : lens.project(T_enu_camera.inverse() * before->second);
      if (there && speed > kFast) {
        ++matches.all;
        matches.wrong += (*seen - *there).norm() > kFalse_px ? 1 : 0;
      }
      if (point.track <= newest_) continue;
      const auto column = static_cast<size_t>(std::lround(seen->x())),
                 row = static_cast<size_t>(std::lround(seen->y()));
      const double depth = shown.depth[row * kWidth + column];
      if (depth < kFarthest) born[point.track] = T_enu_camera * (depth * ray);
    }
    if (!frame.points.empty()) newest_ = std::max(newest_, frame.points.back().track);
    born_ = std::move(born);
  }

 private:
  const Filmed& filmed_;
  std::map<int64_t, Eigen::Vector3d> born_;  ///< in the last picture: where their points are
  int64_t newest_ = 0;
};

struct Outcome {
  ConsistencyAccumulator all;
  Matches matches;
  double way_error = 0.0;  ///< m, largest at an end
  int running = 0;
};

void drive_through(Filmed& filmed, const MsckfConfig& config, bool turn_only, Outcome& outcome) {
  Msckf filter(config);
  PictureTracks tracks(filmed.rig.camera.intrinsics(), std::nullopt, make_front_end({}));
  MatchJudge judge(filmed);
  size_t next = 0;
  for (const ImuSample& imu : filmed.drive.drive.imu) {
    while (next < filmed.pictures.size() && filmed.pictures[next].t_us <= imu.t_us) {
      Shown& shown = filmed.pictures[next++];
      const cv::Mat grey(shown.picture.height, shown.picture.width, CV_8UC1, shown.picture.pixels.data());
      std::optional<CameraMotion> motion;
      if (const auto last = tracks.last_us()) motion = filter.camera_motion(*last, shown.t_us);
      if (motion && turn_only) motion->p_now_before.reset();
      const msckf::SeenFrame frame = tracks.track(shown.t_us, grey, {}, motion);
      judge.judge(shown, frame, outcome.matches);
      filter.add(frame);
    }
    (void)filter.advance(imu);
  }
  const MsckfOutput o = filter.output();
  if (o.phase != MsckfPhase::kRunning || o.reset_counter != 0) return;
  ++outcome.running;
  const Eigen::Matrix<double, 9, 1> e = test::error_of(o.odometry, filmed.drive);
  outcome.all.add(e.head<6>().dot(o.odometry.cov_pose.inverse() * e.head<6>()), 6);
  outcome.all.add(e.tail<3>().dot(o.odometry.cov_velocity.inverse() * e.tail<3>()), 3);
  outcome.way_error = std::max(outcome.way_error, e.head<3>().norm());
}

}  // namespace

TEST_CASE("errors on three filmed drives are what the covariance says, and too much trust in pixels shows") {
  fix_eigen_blocking();
  fix_opencv_threads();
  test::VisualDriveConfig car = test::city_drive(kDuration);
  car.scenario.camera = with_size(car.scenario.camera, kWidth, kHeight);
  car.scenario.camera.layout = CameraLayout::kMono;
  // An even road without slip: over more drives the claim is too small on any, by 1.9 to 2.5 (EVIDENCE.md, E9).
  car.scenario.motion.road_roughness_m3 = car.scenario.motion.rear_slip_rad_per_mps2 = 0.0;
  Outcome honest, turned, bold;
  for (uint64_t seed = 1; seed <= kDrives; ++seed) {
    Filmed filmed = film(car, seed);
    MsckfConfig config = test::filter_config(car);
    config.window.sigma_px = MsckfWindow{}.sigma_px;  // the default, as a user has it
    config.vehicle.T_imu_camera = filmed.rig.T_vehicle_left;
    drive_through(filmed, config, false, honest);
    drive_through(filmed, config, true, turned);
    config.window.sigma_px /= kTooBold;
    config.window.gate = 0.9999999;
    drive_through(filmed, config, false, bold);
  }
  const Band band = chi_square_band(kDrives, kDegrees);
  std::printf(
      "filmed: NEES %.3f (band %.2f to %.2f), %.2f m off at most, %.3f of %d new tracks false; by the turn alone "
      "%.3f; pixels trusted %.0f times as much: NEES %.3f\n",
      honest.all.ratio(), band.low, band.high, honest.way_error, honest.matches.share(), honest.matches.all,
      turned.matches.share(), kTooBold, bold.all.ratio());
  CHECK(honest.running == kDrives);
  CHECK(band.holds(honest.all.ratio()));
  CHECK(honest.way_error < 3.0);
  CHECK(honest.matches.share() < kMostFalse);
  CHECK(turned.matches.share() > kWithoutWay);
  CHECK((bold.running < kDrives || bold.all.ratio() > band.high));
}
