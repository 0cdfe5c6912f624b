/// Start of a map after a loss, and the effect of a restart requested meanwhile.
#include <catch2/catch.hpp>
#include <cstdio>

#include "geometry/determinism.h"
#include "slam/keyframe_tracker.h"
#include "support/street.h"

namespace roadfix {
namespace {

const CameraIntrinsics kLens{480, 160, 280.0, 280.0, 240.0, 80.0, Distortion::kNone, {}};
constexpr int kFrames = 36, kDark = 12, kLight = 18;  // the first dark frame, the first one after it
constexpr int64_t kPeriod_us = 100'000;
constexpr double kStep = 0.8;  // m a frame, straight ahead
const Eigen::Vector3d kAhead{0.0, 0.0, 1.0};

int64_t time_of(int frame) { return kPeriod_us * (frame + 1); }

const std::vector<cv::Mat>& images() {
  static const std::vector<cv::Mat> kPictures = [] {
    fix_eigen_blocking();
    fix_opencv_threads();
    const test::Street street(3);
    std::vector<cv::Mat> all;
    for (int i = 0; i < kFrames; ++i) {
      const SE3 T{Eigen::Quaterniond::Identity(), kStep * i * kAhead};
      const bool dark = i >= kDark && i < kLight;
      all.push_back(dark ? cv::Mat::zeros(kLens.height, kLens.width, CV_8UC1)
                         : street.image(T, kLens, 1.0, static_cast<unsigned>(i + 1)));
    }
    return all;
  }();
  return kPictures;
}

/// A monocular drive with images and wheels, frame by frame.
class Drive {
 public:
  Drive() : tracker_(config(), rig(), make_front_end({}), executor_) {}

  const TrackedFrame& frame(int i) {
    tracker_.speed({time_of(i), SpeedSource::kWheels, 1e6 * kStep / kPeriod_us, 0.02, 0.01});
    return tracker_.process({time_of(i), images()[static_cast<size_t>(i)], {}});
  }
  KeyframeTracker& operator*() { return tracker_; }

 private:
  static KeyframeTrackerConfig config() {
    KeyframeTrackerConfig c;
    c.close_loops = false;  // no relocalisation: always a new map
    return c;
  }
  static CameraRig rig() {
    CameraRig r;
    r.left = kLens;
    return r;
  }

  InlineExecutor executor_;
  KeyframeTracker tracker_;
};

double way(const TrackedFrame& out) { return out.odometry.T_frame_vehicle.p.z(); }

/// A drive with a dark section; at frame `asked` a restart is requested at the pose of that time, 100 m ahead, received
/// half a second later.
struct Restarted {
  int begun = 0, invalid_after = 0;  ///< frames: start of the map, frames without a pose from there on
  double worst = 0.0;                ///< m, after the restart
  int resets = 0;
};

Restarted restarted(int asked) {
  constexpr double kGiven = 100.0;
  constexpr int kHeard = 5;
  Drive drive;
  Restarted result;
  for (int i = 0; i < kFrames; ++i) {
    if (i == asked + kHeard) {
      (*drive).restart({time_of(asked),
                        {Eigen::Quaterniond::Identity(), (kGiven + kStep * asked) * kAhead},
                        1e6 * kStep / kPeriod_us * kAhead,
                        1e-4 * Matrix6d::Identity()});
    }
    const int resets_before = (*drive).last().reset_counter;
    const TrackedFrame& out = drive.frame(i);
    if (i < kLight) continue;
    const bool valid = out.odometry.validity == Validity::kValid;
    if (result.begun == 0 && valid) result.begun = i;
    if (i == asked + kHeard) result.resets = out.reset_counter - resets_before;
    if (result.begun == 0) continue;
    result.invalid_after += valid ? 0 : 1;
    if (i < asked + kHeard) continue;
    if (valid) result.worst = std::max(result.worst, std::abs(way(out) - kGiven - kStep * i));
  }
  return result;
}

TEST_CASE("a restart requested before the map started transforms the map, which continues") {
  const Restarted known = restarted(19), waiting = restarted(14), accused = restarted(25);
  std::printf("restart: map from frame %d and %d, %d and %d frames without a pose after it, %.2f and %.2f m\n",
              known.begun, waiting.begun, known.invalid_after, accused.invalid_after, known.worst, waiting.worst);
  CHECK(known.begun < 19 + 5);
  CHECK(known.invalid_after == 0);
  CHECK(known.worst < 0.1);
  // Requested during an initialisation: no delay.
  CHECK(waiting.begun == known.begun);
  CHECK(waiting.invalid_after == 0);
  CHECK(waiting.worst < 0.1);
  // Requested long after the start of the map: the map is discarded.
  CHECK(accused.begun == known.begun);
  CHECK(accused.invalid_after > 0);
  CHECK(accused.worst < 0.1);
  for (const Restarted& r : {known, waiting, accused}) CHECK(r.resets == 1);
}

TEST_CASE("a transformed map keeps its own accumulated covariance") {
  Drive drive;
  int i = 0;
  while ((*drive).last().odometry.validity != Validity::kValid) (void)drive.frame(i++);
  const int begun = i - 1;
  while (i < 10) (void)drive.frame(i++);
  const auto of_the_map = [](const TrackedFrame& out) -> Matrix6d {
    return out.odometry.cov_pose - out.cov_image - out.cov_map;
  };
  const Matrix6d own = of_the_map((*drive).last());
  const double sigma = 1e-6;
  (*drive).restart({time_of(begun),
                    {Eigen::Quaterniond::Identity(), kStep * begun * kAhead},
                    1e6 * kStep / kPeriod_us * kAhead,
                    sigma * sigma * Matrix6d::Identity()});
  const TrackedFrame& moved = drive.frame(i);
  REQUIRE(moved.odometry.validity == Validity::kValid);
  CHECK(moved.reset_counter == 1);
  for (const int axis : {3, 4}) {
    CHECK(own(axis, axis) > 100.0 * sigma * sigma);
    CHECK(of_the_map(moved)(axis, axis) > 0.8 * own(axis, axis));
  }
}

TEST_CASE("mono's first pose has the velocity of its two images and new tracks") {
  Drive drive;
  int begun = 0;
  while ((*drive).last().odometry.validity != Validity::kValid) (void)drive.frame(begun++);
  const TrackedFrame first = (*drive).last();
  CHECK(first.map_started);
  CHECK(first.odometry.velocity.z() == Approx(8.0).epsilon(0.05));
  const double sigma = std::sqrt(first.odometry.cov_velocity(2, 2));
  CHECK(sigma > 0.0);
  CHECK(sigma < 1.0);
  CHECK((*drive).at(first.odometry.t_us + kPeriod_us / 2).T_frame_vehicle.p.z() ==
        Approx(way(first) + 0.5 * kStep).margin(0.05));
  const auto fresh = std::count_if(first.features.begin(), first.features.end(),
                                   [](const TrackedFeature& f) { return f.status == FeatureStatus::kNew; });
  CHECK(fresh > 20);
  const TrackedFrame& second = drive.frame(begun);
  CHECK(second.num_matches > first.num_inliers);
  CHECK(second.num_inliers > 0.7 * second.num_landmarks_seen);
  CHECK(second.odometry.velocity.z() == Approx(8.0).epsilon(0.05));
}

TEST_CASE("the first velocity after a wait for parallax has a large sigma") {
  const auto first_pose = [](double first_step) {
    Drive drive;
    const test::Street street(3);
    double way = 0.0;
    for (int i = 0; i < 40 && (*drive).last().odometry.validity != Validity::kValid; ++i) {
      const double step = std::min(first_step + 0.015 * i, 0.6);  // m per frame: 1.5 m/s2
      way += step;
      (*drive).speed({time_of(i), SpeedSource::kWheels, 10.0 * step, 0.02, 0.01});
      const SE3 T{Eigen::Quaterniond::Identity(), way * kAhead};
      (*drive).process({time_of(i), street.image(T, kLens, 1.0, static_cast<unsigned>(i + 1)), {}});
      if ((*drive).last().odometry.validity == Validity::kValid) {
        const Odometry& o = (*drive).last().odometry;
        const double error = o.velocity.z() - 10.0 * step, sigma = std::sqrt(o.cov_velocity(2, 2));
        std::printf("first pose in frame %d: speed off by %.2f m/s, sigma %.2f\n", i, error, sigma);
        return std::pair(std::abs(error), sigma);
      }
    }
    return std::pair(1e9, 1.0);
  };
  const auto [error, sigma] = first_pose(0.0);
  CHECK(error > 0.2);  // teeth: the error exists
  CHECK(error < 3.0 * sigma);
  CHECK(first_pose(0.6).second < 0.5 * sigma);  // with steady motion the sigma is smaller
}

TEST_CASE("stereo's first pose has an unknown velocity and reports it") {
  CameraRig rig;
  rig.left = kLens;
  rig.right = kLens;
  rig.T_right_left.p.x() = -0.5;
  InlineExecutor executor;
  KeyframeTracker tracker({}, rig, make_front_end({}), executor);
  const test::Street street(3);
  const auto show = [&](int i) {
    const SE3 T{Eigen::Quaterniond::Identity(), kStep * i * kAhead};
    tracker.process(
        {time_of(i), street.image(T, kLens, 1.0, 1), street.image(T * rig.T_right_left.inverse(), kLens, 1.0, 2)});
    return tracker.last().odometry;
  };
  const Odometry first = show(0), second = show(1);
  CHECK(first.validity == Validity::kValid);
  CHECK(first.velocity.norm() == 0.0);
  CHECK(std::sqrt(first.cov_velocity(2, 2)) > 8.0);
  CHECK(second.velocity.z() == Approx(8.0).epsilon(0.05));
  CHECK(std::sqrt(second.cov_velocity(2, 2)) < 1.0);
}

TEST_CASE("a coasting pose keeps its velocity with growing covariance") {
  Drive drive;
  for (int i = 0; i < kDark; ++i) (void)drive.frame(i);
  const Odometry seen = (*drive).last().odometry;
  double sigma_before = 0.0;
  for (int i = kDark; i < kDark + 3; ++i) {
    const Odometry& o = drive.frame(i).odometry;
    CHECK(o.validity == Validity::kCoasting);
    CHECK(o.velocity.z() == Approx(seen.velocity.z()));
    CHECK(o.T_frame_vehicle.p.z() == Approx(kStep * i).margin(0.1));
    CHECK(std::sqrt(o.cov_velocity(2, 2)) > sigma_before + 0.1);
    for (int k = 0; k < 6; ++k) CHECK(o.cov_pose(k, k) > seen.cov_pose(k, k));  // the accumulated covariance is kept
    sigma_before = std::sqrt(o.cov_velocity(2, 2));
  }
}

TEST_CASE("a map started after a loss includes the unobserved rotation in its covariance") {
  Drive drive;
  for (int i = 0; i < kDark; ++i) (void)drive.frame(i);
  const Matrix6d seen = (*drive).last().odometry.cov_pose;
  int i = kDark;
  while (i < kFrames && !drive.frame(i).map_started) ++i;
  REQUIRE(i < kFrames);
  const Matrix6d& cov = (*drive).last().odometry.cov_pose;
  const double unseen_s = 1e-6 * static_cast<double>(kPeriod_us) * (i - kDark + 1);
  CHECK(std::sqrt(cov(5, 5)) > 0.19 * unseen_s);  // about the vehicle's z: 0.2 rad/s
  CHECK(std::sqrt(cov(5, 5)) < 0.21 * unseen_s + std::sqrt(seen(5, 5)) + 0.01);
  for (const int k : {3, 4}) CHECK(std::sqrt(cov(k, k)) < std::sqrt(seen(k, k)) + 0.01);
}

TEST_CASE("the image that loses a map is the first of the next one") {
  Drive drive;
  for (int i = 0; i < kDark; ++i) (void)drive.frame(i);
  CHECK((*drive).last().state == TrackState::kGood);
  const test::Street elsewhere(7);
  int i = kDark;
  do {
    const SE3 T{Eigen::Quaterniond::Identity(), kStep * i * kAhead};
    (*drive).process({time_of(i), elsewhere.image(T, kLens, 1.0, static_cast<unsigned>(i)), {}});
  } while ((*drive).last().state != TrackState::kLost && ++i < kFrames);
  const TrackedFrame& lost = (*drive).last();
  CHECK(lost.state == TrackState::kLost);
  CHECK(lost.reason == "too few landmarks agree on a pose");
  CHECK(lost.features.size() > 60);
  CHECK(std::all_of(lost.features.begin(), lost.features.end(),
                    [](const TrackedFeature& f) { return f.status == FeatureStatus::kNew; }));
}

}  // namespace
}  // namespace roadfix
