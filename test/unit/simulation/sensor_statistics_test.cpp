// Each sensor's errors have the size that the configuration says, and each check would see it if they had not.
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "simulation/scenarios.h"
#include "simulation/sensors.h"
#include "simulation/simulate.h"

namespace roadfix {
namespace {

using Series = std::vector<double>;

/// Overlapping Allan deviation of a rate series at a cluster of n samples (IEEE Std 952, annex C).
double allan_deviation(const Series& rate, std::size_t n) {
  Series sum(rate.size() + 1, 0.0);
  for (std::size_t i = 0; i < rate.size(); ++i) sum[i + 1] = sum[i] + rate[i];
  double total = 0.0;
  const std::size_t count = rate.size() + 1 - 2 * n;
  for (std::size_t i = 0; i < count; ++i) {
    const double d = (sum[i + 2 * n] - 2.0 * sum[i + n] + sum[i]) / static_cast<double>(n);
    total += d * d;
  }
  return std::sqrt(total / (2.0 * static_cast<double>(count)));
}

double deviation(const Series& x) {
  double sum = 0.0;
  for (const double v : x) sum += v * v;
  return std::sqrt(sum / static_cast<double>(x.size()));
}

double correlation(const Series& a, const Series& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) sum += a[i] * b[i];
  return sum / static_cast<double>(std::min(a.size(), b.size())) / (deviation(a) * deviation(b));
}

bool near(double value, double expected, double relative) { return std::abs(value / expected - 1.0) < relative; }

ScenarioConfig standing(double duration_s, const ImuConfig& imu) {
  ScenarioConfig c = scenario("standing");
  c.duration_s = duration_s;
  c.imu = imu;
  c.truth_rate_hz = 0.1;
  return c;
}

Series gyro_z(const SimulatedDrive& drive) {
  Series x;
  for (const ImuSample& s : drive.imu) x.push_back(s.gyro.z());
  return x;
}

Series accel_y(const SimulatedDrive& drive) {
  Series x;
  for (const ImuSample& s : drive.imu) x.push_back(s.accel.y());
  return x;
}

TEST_CASE("Allan deviation of a standing imu is the configured noise over the root of the cluster time") {
  ImuConfig imu = perfect_imu(100.0);
  imu.gyro_noise_radps_per_rthz = 2e-4;
  imu.accel_noise_mps2_per_rthz = 3e-3;
  const SimulatedDrive drive = simulate(standing(2000.0, imu), 3);
  for (const std::size_t n : {1u, 10u, 100u}) {
    const double root = std::sqrt(static_cast<double>(n) / imu.rate_hz);
    CHECK(near(allan_deviation(gyro_z(drive), n) * root, 2e-4, 0.05));
    CHECK(near(allan_deviation(accel_y(drive), n) * root, 3e-3, 0.05));
    CHECK_FALSE(near(allan_deviation(gyro_z(drive), n) * root, 1.15 * 2e-4, 0.05));
    CHECK_FALSE(near(allan_deviation(accel_y(drive), n) * root, 1.15 * 3e-3, 0.05));
  }
}

/// Allan deviation of a Gauss-Markov process (IEEE Std 952, C.1.6, with q_c^2 = 2 sigma^2 / T).
double gauss_markov_allan(double sigma, double correlation_s, double tau) {
  const double x = tau / correlation_s;
  return sigma * std::sqrt(2.0 / x * (1.0 - (3.0 - 4.0 * std::exp(-x) + std::exp(-2.0 * x)) / (2.0 * x)));
}

TEST_CASE("Allan deviation of the bias is that of its Gauss-Markov process") {
  ImuConfig imu = perfect_imu(20.0);
  imu.gyro_bias_drift_std_radps = 5e-5;
  imu.accel_bias_drift_std_mps2 = 4e-3;
  imu.bias_correlation_s = 5.0;
  const SimulatedDrive drive = simulate(standing(20000.0, imu), 4);
  for (const double tau : {1.0, 5.0, 20.0}) {
    const auto n = static_cast<std::size_t>(tau * imu.rate_hz);
    CHECK(near(allan_deviation(gyro_z(drive), n), gauss_markov_allan(5e-5, 5.0, tau), 0.08));
    CHECK(near(allan_deviation(accel_y(drive), n), gauss_markov_allan(4e-3, 5.0, tau), 0.08));
    CHECK_FALSE(near(allan_deviation(gyro_z(drive), n), gauss_markov_allan(1.2 * 5e-5, 5.0, tau), 0.08));
  }
  const double short_time = allan_deviation(gyro_z(drive), 20);
  CHECK_FALSE(near(short_time, gauss_markov_allan(5e-5, 8.0, 1.0), 0.08));  // a wrong correlation time shows too
}

TEST_CASE("the biases returned are those in the measurements") {
  ImuConfig imu = perfect_imu(50.0);
  imu.gyro_bias_std_radps = 1e-2;
  imu.accel_bias_std_mps2 = 0.1;
  imu.gyro_bias_drift_std_radps = 1e-3;
  imu.accel_bias_drift_std_mps2 = 1e-2;
  imu.gyro_scale_std = imu.accel_scale_std = 0.02;
  ScenarioConfig config = scenario("city_loop");
  config.imu = imu;
  const SimulatedDrive drive = simulate(config, 5);
  config.imu = perfect_imu(50.0);
  const SimulatedDrive perfect = simulate(config, 5);
  for (std::size_t i = 0; i < drive.imu.size(); ++i) {
    const SimulationErrors& e = drive.errors;
    const Eigen::Vector3d gyro = perfect.imu[i].gyro;
    const Eigen::Vector3d accel = perfect.imu[i].accel;
    REQUIRE((gyro + e.gyro_scale.cwiseProduct(gyro) + e.imu_bias[i].gyro - drive.imu[i].gyro).norm() < 1e-15);
    REQUIRE((accel + e.accel_scale.cwiseProduct(accel) + e.imu_bias[i].accel - drive.imu[i].accel).norm() < 1e-13);
  }
}

TEST_CASE("what is drawn once per drive has its configured spread over the seeds") {
  ScenarioConfig config = scenario("standing");
  config.duration_s = 1.0;
  config.imu.rate_hz = 1.0;
  config.imu.gyro_bias_drift_std_radps = 0.0;
  config.imu.mounting_std_rad = {0.03, 0.02, 0.01};
  Series bias, scale, wheel, mounting, hard_iron;
  for (std::uint64_t seed = 0; seed < 1000; ++seed) {
    const SimulatedDrive drive = simulate(config, seed);
    bias.push_back(drive.errors.imu_bias[0].gyro.x());
    scale.push_back(drive.errors.gyro_scale.x());
    wheel.push_back(drive.errors.wheel_scale[0]);
    mounting.push_back(2.0 * drive.errors.q_vehicle_imu.x());
    hard_iron.push_back(drive.errors.hard_iron.z() * 1e6);
  }
  const auto check = [](const Series& x, double sigma) {
    CHECK(near(deviation(x), sigma, 0.09));  // 4 sigma of a standard deviation over 1000 draws
    CHECK_FALSE(near(deviation(x), 1.25 * sigma, 0.09));
  };
  check(bias, config.imu.gyro_bias_std_radps);
  check(scale, config.imu.gyro_scale_std);
  check(wheel, std::hypot(config.wheels.speed_scale_std, config.wheels.wheel_scale_std));
  check(mounting, 0.03);
  check(hard_iron, config.mag.hard_iron_std_ut);
  CHECK(std::abs(correlation(bias, scale)) < 0.13);
  CHECK(std::abs(correlation(bias, wheel)) < 0.13);
  Series shifted(bias.begin() + 1, bias.end());
  CHECK(std::abs(correlation(bias, shifted)) < 0.13);  // neighbouring seeds
}

struct GnssSeries {
  Series east, up, speed_north;
};

/// Measured minus true of every fix, from the fixes themselves.
GnssSeries gnss_errors(const SimulatedDrive& drive) {
  GnssSeries out;
  for (const GnssFix& fix : drive.gnss) {
    const Kinematics k = drive.kinematics_at(fix.t_us);
    const Eigen::Vector3d lever = drive.errors.gnss_lever_arm;
    const Eigen::Vector3d error = drive.anchor.enu(fix.antenna) - k.T_enu_vehicle * lever;
    const Eigen::Vector3d v = k.velocity_enu + k.T_enu_vehicle.q * k.angular_rate.cross(lever);
    out.east.push_back(error.x());
    out.up.push_back(error.z());
    out.speed_north.push_back(fix.velocity->enu.y() - v.y());
  }
  return out;
}

ScenarioConfig gnss_only() {
  ScenarioConfig c = scenario("city_loop");
  c.duration_s = 600.0;
  c.imu = perfect_imu(1.0);
  c.gnss.rate_hz = 10.0;
  return c;
}

TEST_CASE("fixes scatter about the antenna with the configured sigma") {
  ScenarioConfig config = gnss_only();
  config.gnss.sigma_horizontal_m = 0.5;
  config.gnss.sigma_up_m = 0.9;
  config.gnss.sigma_velocity_mps = 0.07;
  const GnssSeries e = gnss_errors(simulate(config, 6));
  CHECK(near(deviation(e.east), 0.5, 0.05));
  CHECK(near(deviation(e.up), 0.9, 0.05));
  CHECK(near(deviation(e.speed_north), 0.07, 0.05));
  CHECK_FALSE(near(deviation(e.east), 0.58, 0.05));
  CHECK(std::abs(correlation(e.east, e.up)) < 0.06);
}

TEST_CASE("the heading of two antennas scatters about the vehicle's") {
  ScenarioConfig config = gnss_only();
  config.gnss.sigma_heading_rad = 0.01;
  Series error;
  const SimulatedDrive drive = simulate(config, 12);
  for (const GnssFix& fix : drive.gnss) {
    REQUIRE(fix.heading);
    const Eigen::Vector3d forward = drive.kinematics_at(fix.t_us).T_enu_vehicle.q * Eigen::Vector3d::UnitX();
    error.push_back(std::remainder(fix.heading->heading - std::atan2(forward.x(), forward.y()), 2.0 * kPi));
    REQUIRE(fix.heading->heading >= 0.0);
  }
  CHECK(near(deviation(error), 0.01, 0.05));
  CHECK_FALSE(near(deviation(error), 0.0115, 0.05));
}

TEST_CASE("multipath is correlated over its correlation time") {
  ScenarioConfig config = gnss_only();
  config.duration_s = 3000.0;
  config.gnss.sigma_horizontal_m = 0.0;
  config.gnss.multipath_sigma_m = 2.0;
  config.gnss.multipath_correlation_s = 5.0;
  const SimulatedDrive drive = simulate(config, 7);
  const Series east = gnss_errors(drive).east;
  CHECK(near(deviation(east), 2.0, 0.15));
  CHECK(correlation(east, Series(east.begin() + 50, east.end())) == Approx(std::exp(-1.0)).margin(0.12));
  CHECK(std::sqrt(drive.gnss[0].cov_enu(0, 0)) == Approx(2.0));
}

TEST_CASE("the latency of a fix is where the antenna was") {
  ScenarioConfig config = gnss_only();
  config.gnss.sigma_horizontal_m = config.gnss.sigma_up_m = 1e-6;
  config.gnss.position_latency_s = 0.15;
  const SimulatedDrive drive = simulate(config, 8);
  double against_now = 0.0;
  for (std::size_t i = 10; i < drive.gnss.size(); i += 10) {
    const Eigen::Vector3d antenna = drive.anchor.enu(drive.gnss[i].antenna);
    const auto error_at = [&](std::int64_t t_us) {
      return (antenna - drive.kinematics_at(t_us).T_enu_vehicle * drive.errors.gnss_lever_arm).norm();
    };
    CHECK(error_at(drive.gnss[i].t_us - 150'000) < 1e-4);
    against_now = std::max(against_now, error_at(drive.gnss[i].t_us));
  }
  CHECK(against_now > 1.5);
}

TEST_CASE("wheels scatter about their scaled rolling speeds") {
  ScenarioConfig config = gnss_only();
  config.wheels.speed_noise_mps = 0.05;
  const SimulatedDrive drive = simulate(config, 9);
  config.wheels.speed_noise_mps = 0.0;
  config.wheels.speed_scale_std = config.wheels.wheel_scale_std = 0.0;
  const SimulatedDrive perfect = simulate(config, 9);
  Series noise;
  for (std::size_t i = 0; i < drive.wheels.size(); ++i) {
    for (std::size_t w = 0; w < 4; ++w) {
      const double scaled = perfect.wheels[i].speeds[w] * (1.0 + drive.errors.wheel_scale[w]);
      noise.push_back(drive.wheels[i].speeds[w] - scaled);
    }
  }
  CHECK(near(deviation(noise), 0.05, 0.03));
  CHECK_FALSE(near(deviation(noise), 0.055, 0.03));
}

TEST_CASE("wheel speeds follow from speed and yaw rate by the vehicle's geometry") {
  ScenarioConfig config = gnss_only();
  config.wheels.speed_noise_mps = config.wheels.speed_scale_std = config.wheels.wheel_scale_std = 0.0;
  const SimulatedDrive drive = simulate(config, 10);
  double turned = 0.0;
  for (const WheelSample& w : drive.wheels) {
    const Odometry truth = drive.truth_at(w.t_us);
    const double rear_difference = (w.speeds[3] - w.speeds[2]) / config.wheels.track_width_m;
    CHECK(rear_difference == Approx(truth.angular_rate.z()).margin(1e-12));
    CHECK(0.5 * (w.speeds[2] + w.speeds[3]) == Approx(truth.velocity.x()).margin(2e-3));
    // The front axle's centre goes by the hypotenuse of speed and wheelbase times yaw rate.
    const Eigen::Vector3d front = truth.velocity + truth.angular_rate.cross(Eigen::Vector3d(2.7, 0.775, 0.0));
    CHECK(w.speeds[0] == Approx(front.head<2>().norm()).margin(5e-3));
    turned = std::max(turned, std::abs(truth.angular_rate.z()));
  }
  CHECK(turned > 0.2);
}

TEST_CASE("the magnetometer's heading is the vehicle's, turned by the declination") {
  ScenarioConfig config = scenario("city_loop");
  config.motion.hill_factor = 0.0;
  config.motion.roll_rad_per_mps2 = config.motion.pitch_rad_per_mps2 = config.motion.road_roughness_m3 = 0.0;
  config.mag.noise_ut = config.mag.hard_iron_std_ut = config.mag.soft_iron_std = 0.0;
  config.mag.declination_deg = 10.0;
  const SimulatedDrive drive = simulate(config, 11);
  const MagSample& m = drive.mag[900];
  const Eigen::Vector3d forward = drive.kinematics_at(m.t_us).T_enu_vehicle.q * Eigen::Vector3d::UnitX();
  const double heading_deg = std::atan2(forward.x(), forward.y()) / kDegree;
  const double magnetic_deg = std::atan2(m.field.y(), m.field.x()) / kDegree;  // clockwise from magnetic north
  CHECK(std::remainder(heading_deg - (magnetic_deg + 10.0), 360.0) == Approx(0.0).margin(0.01));
  CHECK(m.field.norm() == Approx(48.5e-6));
}

}  // namespace
}  // namespace roadfix
