/// Covariance consistency over 50 simulated drives, with siblings that must fail.
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>

#include "drive.h"
#include "simulation/scenarios.h"
#include "statistics/consistency.h"
#include "statistics/summary.h"

namespace roadfix {
namespace {

constexpr int kSeeds = 50;

struct Nees {
  double pose = 0.0;  ///< mean normalised error squared over its degrees of freedom
  double speed = 0.0;
  double median_error = 0.0;  ///< m, horizontal
  double median_sigma = 0.0;  ///< m
};

/// `calibrate` sets the calibration of each drive.
using Calibrate = std::function<void(const SimulatedDrive&, WheelSensors&)>;

Nees nees(const ScenarioConfig& simulated, WheelConfig config, const Calibrate& calibrate = {}) {
  ConsistencyAccumulator pose, speed;
  std::vector<double> errors, sigmas;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const SimulatedDrive drive = simulate(simulated, seed);
    if (calibrate) calibrate(drive, config.sensors);
    const test::EndError end = test::end_error(drive, config);
    pose.add(normalised_square(end.error, end.cov).value(), 6);
    speed.add(end.velocity_error.x() * end.velocity_error.x() / end.cov_velocity(0, 0), 1);
    errors.push_back(end.error.head<2>().norm());
    sigmas.push_back(std::sqrt(end.cov(0, 0) + end.cov(1, 1)));
  }
  const Nees n{pose.ratio(), speed.ratio(), median(errors), median(sigmas)};
  WARN("pose NEES " << n.pose << ", speed " << n.speed << "; median horizontal error " << n.median_error
                    << " m beside sigma " << n.median_sigma << " m");
  return n;
}

ScenarioConfig city() {
  ScenarioConfig s = scenario("city_loop");
  s.duration_s = 60.0;
  s.mag.rate_hz = 0.0;
  s.gnss.rate_hz = 0.1;
  return s;
}

TEST_CASE("pose NEES over 50 drives is consistent") {
  const Nees n = nees(city(), test::matching_config(city()));
  const Band band = chi_square_band(kSeeds, 6);
  CHECK(band.holds(n.pose));
  CHECK(n.speed < 1.7);
  CHECK(n.speed > 0.4);
}

TEST_CASE("pose NEES is consistent with sensor noise times 1.5") {
  ScenarioConfig louder = city();
  louder.imu.gyro_noise_radps_per_rthz *= 1.5;
  louder.imu.accel_noise_mps2_per_rthz *= 1.5;
  louder.wheels.speed_noise_mps *= 1.5;
  CHECK(chi_square_band(kSeeds, 6).holds(nees(louder, test::matching_config(city())).pose));
}

ScenarioConfig askew() {
  ScenarioConfig s = city();
  s.imu.mounting_std_rad.setConstant(0.05);
  s.imu.position_m = {0.7, -0.4, 0.8};
  return s;
}

TEST_CASE("a calibrated IMU misalignment and lever arm give the accuracy of a mounted-at-axle IMU") {
  const auto calibrate = [](const SimulatedDrive& drive, WheelSensors& s) {
    const Eigen::Quaterniond q_imu_vehicle = drive.errors.q_vehicle_imu.conjugate();
    const Eigen::Vector3d forward = q_imu_vehicle * Eigen::Vector3d::UnitX();
    s.mounting_yaw = std::atan2(forward.y(), forward.x());
    s.mounting_pitch = std::asin(-forward.z());
    s.p_imu_axle = -(q_imu_vehicle * drive.config.imu.position_m);
  };
  const Nees n = nees(askew(), test::matching_config(city()), calibrate);
  CHECK(chi_square_band(kSeeds, 6).holds(n.pose));
  CHECK(n.median_error < 6.5);
  // Teeth: misalignment and lever arm ignored.
  CHECK(nees(askew(), test::matching_config(city())).pose > 100.0);
}

TEST_CASE("an uncalibrated misalignment within its stated sigma is consistent") {
  WheelConfig config = test::matching_config(askew());
  config.sensors.p_imu_axle_std = {1.0, 0.5, 0.5};
  const double pose = nees(askew(), config).pose;
  CHECK(pose < chi_square_band(kSeeds, 6).high);
  CHECK(pose > 0.65);
  // Teeth: a third of the sigma.
  config.sensors.mounting_std *= 0.3;
  config.sensors.p_imu_axle_std *= 0.3;
  CHECK(nees(askew(), config).pose > chi_square_band(kSeeds, 6).high);
}

/// The speed 20 s after the start, when a car has sped up to 33 m/s, over its sigma.
double nees_after_speeding_up(double scale_share) {
  ScenarioConfig s = scenario("highway");
  s.duration_s = 20.0;
  s.mag.rate_hz = 0.0;
  s.gnss.rate_hz = 0.1;
  WheelConfig config = test::matching_config(s);
  config.sensors.wheel_scale_std *= scale_share;
  return nees(s, config).speed;
}

TEST_CASE("a car that speeds up does not believe its accelerometer more than it may") {
  CHECK(chi_square_band(kSeeds, 1).holds(nees_after_speeding_up(1.0)));
  // Teeth: two thirds of the wheels' scale.
  CHECK(nees_after_speeding_up(0.67) > chi_square_band(kSeeds, 1).high);
}

TEST_CASE("teeth: an overconfident wheel scale fails") {
  WheelConfig config = test::matching_config(city());
  config.sensors.wheel_scale_std *= 0.5;
  CHECK(nees(city(), config).pose > chi_square_band(kSeeds, 6).high);
}

TEST_CASE("teeth: a gyro noise understated four times fails") {
  WheelConfig config = test::matching_config(city());
  config.sensors.gyro_noise *= 0.25;
  config.sensors.gyro_scale_std *= 0.25;
  config.sensors.gyro_bias_std *= 0.25;
  CHECK(nees(city(), config).pose > chi_square_band(kSeeds, 6).high);
}

TEST_CASE("teeth: an underconfident filter fails at the lower bound") {
  WheelConfig config = test::matching_config(city());
  config.sensors.wheel_scale_std *= 3.0;
  config.sensors.accel_bias_std *= 3.0;
  config.sensors.gyro_scale_std *= 3.0;
  config.tuning.sideslip_noise *= 3.0;
  CHECK(nees(city(), config).pose < chi_square_band(kSeeds, 6).low);
}

}  // namespace
}  // namespace roadfix
