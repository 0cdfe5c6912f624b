// Output covariance against the configured sensor noise.
#include <catch2/catch.hpp>
#include <cmath>

#include "drive.h"
#include "simulation/scenarios.h"

namespace roadfix {

using namespace wheel;  // indices of the error state
namespace {

using test::matching_config;
using test::run;

ScenarioConfig tunnel(double duration_s) {
  ScenarioConfig s = scenario("tunnel_dark");
  s.duration_s = duration_s;
  return s;
}

TEST_CASE("yaw from wheel speeds has the uncertainty of the wheel yaw rate") {
  const ScenarioConfig s = tunnel(40.0);
  SimulatedDrive drive = simulate(s, 9);
  std::erase_if(drive.imu, [&](const ImuSample& imu) { return imu.t_us > s.start_utime + 20'000'000; });
  const auto yaw_variance = [&](double bias_std) {
    WheelConfig config = matching_config(s);
    config.sensors.wheel_yaw_bias_std = bias_std;
    WheelOdometry odometry(config);
    run(drive, odometry, [](const WheelOdometry&) {});
    return odometry.odometry().cov_pose(5, 5);
  };
  // Constant yaw rate error over 20 s, less the IMU time-out.
  CHECK(yaw_variance(0.02) - yaw_variance(0.0) == Approx(std::pow(0.02 * 20.0, 2)).epsilon(0.1));
}

TEST_CASE("the initial tilt covariance follows the accelerometer's noise and bias") {
  const ScenarioConfig s = tunnel(5.0);
  const SimulatedDrive drive = simulate(s, 9);
  for (const double bias_std : {0.0, 0.02}) {
    WheelConfig config = matching_config(s);
    config.sensors.accel_bias_std = bias_std;
    config.sensors.accel_noise = 0.05;
    config.tuning.align_time = 0.25;
    std::optional<WheelState> first;
    WheelOdometry odometry(config);
    run(drive, odometry, [&](const WheelOdometry& o) {
      if (!first) first = o.state();
    });
    const WheelCovariance& P = first.value().P;
    const double of_noise = 0.05 / std::sqrt(0.25) / kStandardGravity, of_bias = bias_std / kStandardGravity;
    CHECK(first->sigma(kRoll) == Approx(std::hypot(of_noise, of_bias)).epsilon(0.1));
    CHECK(first->sigma(kPitch) == Approx(std::hypot(of_noise, of_bias)).epsilon(0.1));
    CHECK(P(kRoll, kAccelBias + 1) == Approx(-of_bias * bias_std).epsilon(0.1).margin(1e-12));
    CHECK(P(kPitch, kAccelBias) == Approx(of_bias * bias_std).epsilon(0.1).margin(1e-12));
    CHECK((P - P.transpose()).cwiseAbs().maxCoeff() == 0.0);
  }
}

TEST_CASE("lateral velocity covariance includes the direction noise over the averaging time") {
  const ScenarioConfig s = tunnel(20.0);
  const SimulatedDrive drive = simulate(s, 9);
  const auto across = [&](double sideslip_noise, double align_time) {
    WheelConfig config = matching_config(s);
    config.tuning.sideslip_noise = sideslip_noise;
    config.tuning.align_time = align_time;
    WheelOdometry odometry(config);
    run(drive, odometry, [](const WheelOdometry&) {});
    return std::pair{odometry.odometry().cov_velocity(1, 1), odometry.state().x(kSpeed)};
  };
  for (const double align_time : {0.25, 0.5}) {
    const auto [with, speed] = across(2e-3, align_time);
    CHECK(with - across(0.0, align_time).first == Approx(std::pow(2e-3 * speed, 2) / align_time).epsilon(0.02));
  }
}

}  // namespace
}  // namespace roadfix
