/// The navigation filter on simulated drives with tracks in place of pictures; prints one JSON object a line.
///   navigation_tracks SCENARIO FIRST_SEED LAST_SEED [--eyes 0|1|2] [--no-wheels] [--noise FACTOR] [--turned DEG] [--late S]
///                     [--gnss SIGMA_M] [--white PX]
/// Tracks have the noise of drawn pictures (with_noise_of_pictures), or PX white. The longest time without fixes counts:
/// h_end_m is the horizontal error at its end, h_last_m its root mean square over the last 10 s, way_m what was driven in
/// it; h_all_m that of the whole drive once there is a pose; frame_ms: CPU of the filter, all inputs, over the pictures. nees: of place and of yaw and velocity there.
#include <cmath>
#include <cstdio>
#include <string>

#include "geometry/determinism.h"
#include "geometry/frames.h"
#include "geometry/so3.h"
#include "navigation/navigation.h"
#include "program.h"
#include "simulation/scenarios.h"
#include "support/track_drive.h"

namespace roadfix {
namespace {

constexpr int64_t kScored_us = 500'000;
constexpr int64_t kOutage_us = 2'000'000;
constexpr double kLast_s = 10.0;

struct Options {
  std::string scenario;
  int first = 1, last = 1, eyes = 1;
  bool wheels = true;
  double noise = 1.0, turned_deg = 0.0, late_s = 0.0, gnss_m = 0.0, white_px = 0.0;
};

navigation::NavigationConfig config_of(const test::TrackDrive& d, const Options& o) {
  const ScenarioConfig& s = d.drive.config;
  navigation::NavigationConfig c;
  navigation::VehicleFacts& v = c.facts;
  v.imu = {s.imu.gyro_noise_radps_per_rthz, s.imu.accel_noise_mps2_per_rthz};
  v.gyro_bias_std = s.imu.gyro_bias_std_radps;
  v.accel_bias_std = s.imu.accel_bias_std_mps2;
  v.scale_std = s.imu.gyro_scale_std;
  const double ratio = s.imu.gyro_bias_std_radps / s.imu.gyro_bias_drift_std_radps;
  v.correlation_s = s.imu.bias_correlation_s * (1.0 + ratio * ratio);
  const double accel_ratio = s.imu.accel_bias_std_mps2 / s.imu.accel_bias_drift_std_mps2;
  v.accel_correlation_s = s.imu.bias_correlation_s * (1.0 + accel_ratio * accel_ratio);
  v.wheels.speed_noise = s.wheels.speed_noise_mps;
  v.wheel_scale_std = std::hypot(s.wheels.speed_scale_std, s.wheels.wheel_scale_std);
  v.mounting_std = s.imu.mounting_std_rad.cwiseMax(1e-3);
  v.p_imu_antenna = s.gnss.lever_arm_m - s.imu.position_m;
  v.p_imu_axle_std.setConstant(0.05);
  c.sources.wheel_speed = o.wheels;
  if (o.eyes == 0) return c;
  navigation::CameraFacts& camera = v.camera.emplace();
  camera.left = d.rig.camera.intrinsics();
  if (o.eyes == 2) camera.right = camera.left;
  const SE3 T_vehicle_imu{Eigen::Quaterniond::Identity(), s.imu.position_m};
  camera.T_imu_camera = T_vehicle_imu.inverse() * d.T_vehicle_left;
  camera.T_imu_camera.q = camera.T_imu_camera.q * exp_q({0.0, o.turned_deg * kDegree, 0.0});
  camera.turn_std = std::max(1e-3, s.camera.mounting_std_deg * kDegree);
  camera.place_std = std::max(0.01, s.camera.mounting_std_m);
  camera.T_left_right = d.T_left_right;
  c.camera.tracks.noise_factor = o.noise;
  return c;
}

TrackPicture picture_of(const test::TrackFrame& frame, const Options& o) {
  TrackPicture p;
  p.t_us = frame.t_us + std::llround(1e6 * o.late_s);
  for (const TrackObservation& t : frame.tracks) {
    TrackSighting s{t.id, t.left, {}, 0.1, 0.15, 0.2};
    if (o.white_px > 0.0) s = {t.id, t.left, {}, o.white_px, 0.0, o.white_px};
    if (o.eyes == 2) s.right = t.right;
    p.tracks.push_back(s);
  }
  return p;
}

struct Sample {
  double t_s = 0.0, h = 0.0, nees_place = 0.0, nees_yaw = 0.0, nees_velocity = 0.0;
  bool valid = false;
};

Sample sample(navigation::Navigation& filter, const SimulatedDrive& drive, int64_t start_us) {
  const navigation::NavigationOutput out = filter.output();
  const Odometry& o = out.odometry;
  Sample s;
  s.t_s = seconds_between(start_us, o.t_us);
  s.valid = o.validity != Validity::kInvalid;
  if (!s.valid) return s;
  const Odometry truth = drive.truth_at(o.t_us);
  const EnuAnchor enu(*filter.anchor());
  const Eigen::Vector3d arm = drive.config.imu.position_m;
  SE3 T;
  T.p = enu.enu(drive.anchor.geodetic(truth.T_frame_vehicle * arm));
  T.q = Eigen::Quaterniond(enu.R_ecef_enu().transpose() * drive.anchor.R_ecef_enu()) * truth.T_frame_vehicle.q *
        drive.errors.q_vehicle_imu;
  const Vector6d e = local(o.T_frame_vehicle, T);
  const Eigen::Vector3d ve =
      drive.errors.q_vehicle_imu.conjugate() * (truth.velocity + truth.angular_rate.cross(arm)) - o.velocity;
  s.h = e.head<2>().norm();
  s.nees_place = e.head<2>().dot(o.cov_pose.topLeftCorner<2, 2>().inverse() * e.head<2>()) / 2.0;
  s.nees_yaw = e(5) * e(5) / o.cov_pose(5, 5);
  s.nees_velocity = ve.dot(o.cov_velocity.inverse() * ve) / 3.0;
  return s;
}

/// Begin and end of the longest time without fixes, s after the start; the whole drive where there is none.
std::pair<double, double> outage(const SimulatedDrive& drive) {
  const int64_t start = drive.imu.front().t_us;
  int64_t begin = start, end = drive.imu.back().t_us, longest = kOutage_us;
  for (size_t i = 1; i < drive.gnss.size(); ++i) {
    const int64_t gap = drive.gnss[i].t_us - drive.gnss[i - 1].t_us;
    if (gap <= longest) continue;
    longest = gap;
    begin = drive.gnss[i - 1].t_us;
    end = drive.gnss[i].t_us;
  }
  return {seconds_between(start, begin), seconds_between(start, end)};
}

void drive(const Options& o, uint64_t seed) {
  ScenarioConfig config = scenario(o.scenario);
  if (o.gnss_m > 0.0) config.gnss.sigma_horizontal_m = o.gnss_m;
  const TrackConfig tracks = o.white_px > 0.0 ? TrackConfig{.noise_px = o.white_px} : with_noise_of_pictures({});
  const test::TrackDrive d = test::make_track_drive(config, seed, tracks);
  navigation::Navigation filter(config_of(d, o));
  const int64_t start = d.drive.imu.front().t_us;
  const auto [begin, end] = outage(d.drive);
  std::vector<Sample> samples;
  double used = 0.0, refused = 0.0, misfit = 0.0, updates = 0.0;
  int64_t next = start;
  double fit_s = 0.0;
  double spent_ms = 0.0;
  int pictures = 0;
  for (const test::DriveEvent& e : d.events) {
    pictures += std::holds_alternative<test::TrackFrame>(e) ? 1 : 0;
    const double before_ms = bench::cpu_ms();
    if (const auto* fix = std::get_if<GnssFix>(&e)) filter.add(*fix);
    if (const auto* wheels = std::get_if<WheelSample>(&e)) filter.add(*wheels);
    if (const auto* frame = std::get_if<test::TrackFrame>(&e); frame != nullptr && o.eyes > 0)
      filter.add(picture_of(*frame, o));
    const auto* imu = std::get_if<ImuSample>(&e);
    if (imu != nullptr) (void)filter.advance(*imu);
    spent_ms += bench::cpu_ms() - before_ms;
    if (imu == nullptr) continue;
    for (const navigation::AidingRecord& r : filter.records()) {
      if (r.source != navigation::AidingSource::kCameraTracks) continue;
      used += filter.camera()->counts().used;
      refused += filter.camera()->counts().refused;
      misfit += filter.camera()->misfit();
      ++updates;
    }
    filter.clear_records();
    if (imu->t_us < next) continue;
    next += kScored_us;
    samples.push_back(sample(filter, d.drive, start));
    if (filter.camera() != nullptr && filter.camera()->fitness() == navigation::CameraFitness::kFit)
      fit_s += 1e-6 * kScored_us;
  }
  double all = 0.0, last = 0.0, at_end = 0.0;
  int count = 0, count_last = 0;
  Sample ended;
  for (const Sample& s : samples) {
    if (!s.valid) continue;
    all += s.h * s.h;
    ++count;
    if (s.t_s > end) continue;
    if (s.t_s > end - kLast_s) {
      last += s.h * s.h;
      ++count_last;
    }
    at_end = s.h;
    ended = s;
  }
  double way = 0.0;
  for (double t = begin; t < end; t += 0.1)
    way += 0.1 * d.drive.truth_at(start + std::llround(1e6 * t)).velocity.norm();
  std::printf(
      "{\"seed\": %d, \"h_end_m\": %.3f, \"h_last_m\": %.3f, \"way_m\": %.0f, \"h_all_m\": %.3f, \"nees_place\": %.2f, "
      "\"nees_yaw\": %.2f, "
      "\"nees_velocity\": %.2f, \"fit_s\": %.0f, \"used\": %.0f, \"refused\": %.0f, \"misfit\": %.2f, \"resets\": "
      "%d, \"frame_ms\": %.3f}\n",
      static_cast<int>(seed), at_end, std::sqrt(last / std::max(1, count_last)), way,
      std::sqrt(all / std::max(1, count)), ended.nees_place, ended.nees_yaw, ended.nees_velocity, fit_s, used, refused,
      misfit / std::max(1.0, updates), filter.output().reset_counter, spent_ms / std::max(1, pictures));
  std::fflush(stdout);
}

Options parse(int argc, char** argv) {
  if (argc < 4) throw std::invalid_argument("usage: navigation_tracks SCENARIO FIRST_SEED LAST_SEED [options]");
  Options o{argv[1], std::stoi(argv[2]), std::stoi(argv[3])};
  for (int i = 4; i < argc; ++i) {
    const std::string key = argv[i];
    if (key == "--no-wheels") {
      o.wheels = false;
      continue;
    }
    if (++i >= argc) throw std::invalid_argument(key + " needs a value");
    const double value = std::stod(argv[i]);
    if (key == "--eyes")
      o.eyes = static_cast<int>(value);
    else if (key == "--noise")
      o.noise = value;
    else if (key == "--turned")
      o.turned_deg = value;
    else if (key == "--late")
      o.late_s = value;
    else if (key == "--gnss")
      o.gnss_m = value;
    else if (key == "--white")
      o.white_px = value;
    else
      throw std::invalid_argument("unknown option " + key);
  }
  return o;
}

int run(int argc, char** argv) {
  fix_eigen_blocking();
  const Options options = parse(argc, argv);
  for (int seed = options.first; seed <= options.last; ++seed) drive(options, static_cast<uint64_t>(seed));
  return 0;
}

}  // namespace
}  // namespace roadfix

int main(int argc, char** argv) { return roadfix::bench::run_as("navigation_tracks", roadfix::run, argc, argv); }
