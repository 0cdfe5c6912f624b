/// Drives of the navigation filter without GNSS on tracks without pixels, with the noise of drawn pictures; prints one JSON
/// object a line. Cars differ in what the filter's prior leaves open: how the imu is mounted, what the rear tyres slip.
///   msckf_drives city|short|turn|highway FIRST_SEED LAST_SEED [--wheels]
/// first_s: of the first valid pose.
/// drift_pct: error of the position at the end over the way driven. scale_pct: of the distance driven in the ten
/// seconds after the turn. nees: mean of position, attitude and velocity at the end.
#include <cstdio>
#include <cstring>

#include "geometry/determinism.h"
#include "program.h"
#include "simulation/random.h"
#include "support/visual_drive.h"
#include "vehicle/driving.h"

namespace roadfix {
namespace {

constexpr double kLearntScaleStd = 1e-3;
constexpr double kTurnScored = 12.0;   // s after it, at the new speed
constexpr double kMountingStd = 1e-3;  // rad

test::VisualDriveConfig street_of(const std::string& name) {
  if (name == "city") return test::city_drive(240.0);
  if (name == "highway") return test::highway_drive(180.0);
  if (name == "short") return test::city_drive(60.0);
  if (name == "turn") return test::turn_drive();
  throw std::invalid_argument("no drive named " + name);
}

test::VisualDriveConfig drive_of(const std::string& name) {
  test::VisualDriveConfig car = street_of(name);
  car.tracks = with_noise_of_pictures(car.tracks);
  car.scenario.imu.mounting_std_rad.setConstant(kMountingStd);
  return car;
}

struct Result {
  double way = 0.0, error = 0.0, sigma = 0.0, nees = 0.0, scale = 0.0;
  int resets = 0;
  double first_s = -1.0, invalid_s = 0.0;  ///< first valid pose; without one after it
};

double length_of(const std::vector<Eigen::Vector3d>& points) {
  double sum = 0.0;
  for (size_t i = 1; i < points.size(); ++i) sum += (points[i] - points[i - 1]).norm();
  return sum;
}

Result drive(test::VisualDriveConfig car, uint64_t seed, bool wheels, bool learnt, double scored_from_s) {
  RandomStream tyres(seed, 0x5119);
  car.scenario.motion.rear_slip_rad_per_mps2 =
      std::max(0.0, vehicle::kRearSlip + vehicle::kRearSlipStd * tyres.normal());
  test::VisualDrive d = test::make_drive(car, seed);
  navigation::NavigationConfig config = test::filter_config(car);
  config.sources.wheel_speed = wheels;
  if (learnt) {  // what GNSS has taught before: the rear wheels' scale but for one part in a thousand
    const auto& scale = d.drive.errors.wheel_scale;
    RandomStream random(seed, 0x3CA1E);
    const double known = 0.5 * (scale[2] + scale[3]) + kLearntScaleStd * random.normal();
    for (WheelSample& w : d.drive.wheels)
      for (double& speed : w.speeds) speed /= 1.0 + known;
    config.facts.wheel_scale_std = kLearntScaleStd;
  }
  navigation::Navigation filter(config);
  Result r;
  std::vector<Eigen::Vector3d> truth, estimate, all;
  const int64_t start = d.drive.imu.front().t_us;
  navigation::NavigationOutput last;
  bool begun = false;
  int count = 0;
  test::run(filter, d, wheels, [&](navigation::Navigation& f) {
    if (++count % 10 != 0) return;
    last = f.output();
    const bool valid = last.odometry.validity != Validity::kInvalid;
    if (!begun && valid) r.first_s = seconds_between(start, last.odometry.t_us);
    begun = begun || valid;
    if (begun && !valid) r.invalid_s += 0.1;
    all.push_back(d.drive.truth_at(last.odometry.t_us).T_frame_vehicle.p);
    if (seconds_between(start, last.odometry.t_us) < scored_from_s) return;
    truth.push_back(all.back());
    estimate.push_back(last.imu.T_frame_vehicle.p);
  });
  const Eigen::Matrix<double, 9, 1> e = test::error_of(last.imu, d);
  const auto square = [](const Eigen::Vector3d& x, const Eigen::Matrix3d& P) { return x.dot(P.inverse() * x) / 3.0; };
  const Matrix6d& P = last.imu.cov_pose;
  r.way = length_of(all);
  r.error = e.head<3>().norm();
  r.sigma = std::sqrt(P.topLeftCorner<3, 3>().trace());
  r.nees = (square(e.head<3>(), P.topLeftCorner<3, 3>()) + square(e.segment<3>(3), P.bottomRightCorner<3, 3>()) +
            square(e.tail<3>(), last.imu.cov_velocity)) /
           3.0;
  if (truth.size() > 1) r.scale = length_of(estimate) / length_of(truth) - 1.0;
  r.resets = last.reset_counter;
  return r;
}

int run(int argc, char** argv) {
  if (argc < 4)
    throw std::invalid_argument("usage: msckf_drives city|short|turn|highway FIRST_SEED LAST_SEED [--wheels]");
  fix_eigen_blocking();
  const std::string name = argv[1];
  const bool wheels = argc > 4 && std::strcmp(argv[4], "--wheels") == 0;
  const test::VisualDriveConfig car = drive_of(name);
  const double from = name == "turn" ? car.scenario.duration_s - kTurnScored : 0.0;
  for (int seed = std::stoi(argv[2]); seed <= std::stoi(argv[3]); ++seed) {
    const Result r = drive(car, static_cast<uint64_t>(seed), wheels, wheels && name == "city", from);
    std::printf(
        "{\"seed\": %d, \"way_m\": %.1f, \"error_m\": %.3f, \"drift_pct\": %.4f, \"sigma_m\": %.3f, \"scale_pct\": "
        "%.4f, "
        "\"nees\": %.3f, \"resets\": %d, \"first_s\": %.2f, \"invalid_s\": %.1f}\n",
        seed, r.way, r.error, 100.0 * r.error / r.way, r.sigma, 100.0 * std::abs(r.scale), r.nees, r.resets, r.first_s,
        r.invalid_s);
    std::fflush(stdout);
  }
  return 0;
}

}  // namespace
}  // namespace roadfix

int main(int argc, char** argv) { return roadfix::bench::run_as("msckf_drives", roadfix::run, argc, argv); }
