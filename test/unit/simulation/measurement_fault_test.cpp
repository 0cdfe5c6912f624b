// What faults do to what the sensors measure: places, speeds, rates, fields, noise.
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "unit/simulation/faulty_drive.h"

namespace roadfix {
namespace {

using test::drive_with;
using test::faulty_scenario;

/// Differences fault minus none of the GNSS position, for fixes within the fault's time.
std::vector<Eigen::Vector3d> moved_by(const std::string& fault) {
  const SimulatedDrive before = simulate(faulty_scenario(), 3);
  const SimulatedDrive after = drive_with(fault);
  std::vector<Eigen::Vector3d> moved;
  for (std::size_t i = 0; i < before.gnss.size(); ++i) {
    const double t_s = seconds_between(before.config.start_utime, before.gnss[i].t_us);
    if (!test::during_fault(t_s)) continue;
    moved.push_back(before.anchor.enu(after.gnss[i].antenna) - before.anchor.enu(before.gnss[i].antenna));
  }
  return moved;
}

TEST_CASE("gnss faults move the fixes as they say") {
  for (const Eigen::Vector3d& d : moved_by("gnss.bias@30+20:east_m=15,up_m=-2")) {
    CHECK((d - Eigen::Vector3d(15.0, 0.0, -2.0)).norm() < 1e-2);
  }
  const auto ramp = moved_by("gnss.ramp@30+20:east_mps=0,north_mps=0.5");
  CHECK(ramp.front().norm() < 1e-6);
  CHECK((ramp.back() - Eigen::Vector3d(0.0, 9.9, 0.0)).norm() < 1e-2);
  const auto back = moved_by("gnss.reacquire@30+20:error_m=8,decay_s=5");
  CHECK(back.front().head<2>().norm() == Approx(8.0).epsilon(1e-3));
  CHECK(back[25].head<2>().norm() == Approx(8.0 * std::exp(-1.0)).epsilon(1e-3));
  CHECK(back[25].normalized().dot(back.front().normalized()) > 0.9999);
}

TEST_CASE("multipath is as large and as correlated as it says, single, and its sigma claims what it should") {
  ScenarioConfig config = faulty_scenario();
  config.duration_s = 2000.0;
  const std::string text = "gnss.multipath@0:sigma_m=4,correlation_s=6,velocity_sigma_mps=0.3,claim=0.5";
  const SimulatedDrive drive = drive_with(text, config);
  double sum = 0.0;
  double lagged = 0.0;
  double speed = 0.0;
  for (std::size_t i = 0; i + 30 < drive.gnss.size(); ++i) {
    const Eigen::Vector3d& e = drive.errors.gnss[i].position;
    sum += e.head<2>().squaredNorm();
    lagged += e.head<2>().dot(drive.errors.gnss[i + 30].position.head<2>());
    speed += drive.errors.gnss[i].velocity.squaredNorm();
  }
  const double n = static_cast<double>(drive.gnss.size() - 30);
  CHECK(std::sqrt(sum / (2.0 * n)) == Approx(4.0).epsilon(0.15));
  CHECK(lagged / sum == Approx(std::exp(-1.0)).margin(0.12));
  CHECK(std::sqrt(speed / (3.0 * n)) == Approx(std::hypot(0.3, 0.03)).epsilon(0.05));
  CHECK(drive.gnss[50].fix_type == FixType::kSingle);
  CHECK(std::sqrt(drive.gnss[50].cov_enu(0, 0)) == Approx(0.5 * 4.0).epsilon(0.01));
}

TEST_CASE("a claim lies about sigma alone") {
  const SimulatedDrive before = simulate(faulty_scenario(), 3);
  const SimulatedDrive after = drive_with("gnss.claim@0:factor=0.1");
  CHECK(std::sqrt(after.gnss[9].cov_enu(0, 0)) == Approx(0.1 * std::sqrt(before.gnss[9].cov_enu(0, 0))));
  CHECK(after.gnss[9].antenna.latitude == before.gnss[9].antenna.latitude);
}

TEST_CASE("latency gives where the antenna was") {
  ScenarioConfig config = faulty_scenario();
  config.gnss.sigma_horizontal_m = config.gnss.sigma_up_m = 1e-6;
  const SimulatedDrive drive = drive_with("gnss.latency@0:position_s=0.2,velocity_s=0", config);
  for (std::size_t i = 2; i < drive.gnss.size(); i += 7) {
    const SE3 then = drive.kinematics_at(drive.gnss[i].t_us - 200'000).T_enu_vehicle;
    REQUIRE((drive.anchor.enu(drive.gnss[i].antenna) - then * config.gnss.lever_arm_m).norm() < 1e-4);
  }
}

TEST_CASE("wheels slip, lock, scale and lose their sign") {
  ScenarioConfig config = faulty_scenario();
  config.motion.route = RouteKind::kCarPark;
  config.wheels.speed_noise_mps = config.wheels.speed_scale_std = config.wheels.wheel_scale_std = 0.0;
  const SimulatedDrive before = simulate(config, 3);
  const SimulatedDrive slip = drive_with("wheels.slip@0:ratio=0.2", config);
  const SimulatedDrive lock = drive_with("wheels.lock@0", config);
  const SimulatedDrive scale = drive_with("wheels.scale@0:ratio=0.03", config);
  const SimulatedDrive magnitude = drive_with("wheels.unsigned@0", config);
  double slowest = 0.0;
  for (std::size_t i = 0; i < before.wheels.size(); ++i) {
    const auto& v = before.wheels[i].speeds;
    slowest = std::min(slowest, v[2]);
    CHECK(slip.wheels[i].speeds[0] == v[0]);
    CHECK(slip.wheels[i].speeds[2] == Approx(1.2 * v[2]).margin(1e-12));
    CHECK(scale.wheels[i].speeds[1] == Approx(1.03 * v[1]).margin(1e-12));
    CHECK(std::abs(lock.wheels[i].speeds[3]) == 0.0);
    CHECK(magnitude.wheels[i].speeds[2] == std::abs(v[2]));
    CHECK(magnitude.wheels[i].direction == WheelDirection::kUnknown);
  }
  CHECK(slowest < -1.0);
}

TEST_CASE("imu bias, noise and saturation") {
  const SimulatedDrive before = simulate(faulty_scenario(), 3);
  const SimulatedDrive bias = drive_with("imu.bias@0:gyro_z_radps=0.02,accel_x_mps2=0.3");
  const SimulatedDrive clipped = drive_with("imu.saturation@0:gyro_radps=0.1,accel_mps2=9");
  double fastest = 0.0;
  for (std::size_t i = 0; i < before.imu.size(); ++i) {
    CHECK(bias.imu[i].gyro.z() - before.imu[i].gyro.z() == Approx(0.02).margin(1e-12));
    CHECK(bias.imu[i].accel.x() - before.imu[i].accel.x() == Approx(0.3).margin(1e-12));
    CHECK(bias.errors.imu_bias[i].gyro.z() - before.errors.imu_bias[i].gyro.z() == Approx(0.02).margin(1e-12));
    CHECK(clipped.imu[i].gyro.cwiseAbs().maxCoeff() <= 0.1);
    CHECK(clipped.imu[i].accel.z() <= 9.0);
    fastest = std::max(fastest, before.imu[i].gyro.z());
  }
  CHECK(fastest > 0.2);
}

TEST_CASE("a disturbed field is added in vehicle axes") {
  const SimulatedDrive before = simulate(faulty_scenario(), 3);
  const SimulatedDrive after = drive_with("mag.disturb@0:x_ut=20,y_ut=0,z_ut=-5");
  const Eigen::Vector3d added = (after.mag[700].field - before.mag[700].field) * 1e6;
  CHECK((added - Eigen::Vector3d(20.0, 0.0, -5.0)).norm() < 1e-9);
}

TEST_CASE("what is stuck repeats its last values under new stamps") {
  const SimulatedDrive drive = drive_with("imu.stuck@30+20");
  std::size_t same = 0;
  for (std::size_t i = 1; i < drive.imu.size(); ++i) {
    same += drive.imu[i].gyro == drive.imu[i - 1].gyro ? 1U : 0U;
    REQUIRE(drive.imu[i].t_us > drive.imu[i - 1].t_us);
  }
  CHECK(same == 2000);
}

/// Standard deviation over the drive's fault time of what a noise fault of this factor leaves beyond the same noise
/// at 1.
template <class Value>
double added_noise(const SimulatedDrive& before, const SimulatedDrive& after, std::size_t count, const Value& value) {
  double sum = 0.0;
  for (std::size_t i = 0; i < count; ++i) sum += std::pow(value(after, i) - value(before, i), 2);
  return std::sqrt(sum / static_cast<double>(count));
}

TEST_CASE("a noise fault is the sensor's white noise times its factor and nobody is told") {
  // The same draws three times as large: the difference is twice the noise.
  ScenarioConfig config = faulty_scenario();
  config.wheels.resolution_mps = 0.0;
  const SimulatedDrive plain = simulate(config, 3);
  const auto drive = [&](const char* text) { return drive_with(text, config); };
  const SimulatedDrive imu = drive("imu.noise@0:factor=3");
  const double gyro = config.imu.gyro_noise_radps_per_rthz * std::sqrt(config.imu.rate_hz);
  CHECK(added_noise(plain, imu, imu.imu.size(), [](const auto& d, auto i) { return d.imu[i].gyro.x(); }) ==
        Approx(2.0 * gyro).epsilon(0.05));
  const double accel = config.imu.accel_noise_mps2_per_rthz * std::sqrt(config.imu.rate_hz);
  CHECK(added_noise(plain, imu, imu.imu.size(), [](const auto& d, auto i) { return d.imu[i].accel.y(); }) ==
        Approx(2.0 * accel).epsilon(0.05));
  const SimulatedDrive gnss = drive("gnss.noise@0:factor=3");
  CHECK(added_noise(plain, gnss, gnss.gnss.size(), [](const auto& d, auto i) {
          return d.anchor.enu(d.gnss[i].antenna).x();
        }) == Approx(2.0 * config.gnss.sigma_horizontal_m).epsilon(0.1));
  CHECK(gnss.gnss[40].cov_enu == plain.gnss[40].cov_enu);
  const SimulatedDrive wheels = drive("wheels.noise@0:factor=3");
  CHECK(added_noise(plain, wheels, wheels.wheels.size(), [](const auto& d, auto i) { return d.wheels[i].speeds[1]; }) ==
        Approx(2.0 * config.wheels.speed_noise_mps).epsilon(0.08));
  const SimulatedDrive mag = drive("mag.noise@0:factor=3");
  CHECK(added_noise(plain, mag, mag.mag.size(), [](const auto& d, auto i) { return 1e6 * d.mag[i].field.z(); }) ==
        Approx(2.0 * config.mag.noise_ut).epsilon(0.08));
}

TEST_CASE("fixes without velocity have none and keep their position") {
  const SimulatedDrive before = simulate(faulty_scenario(), 3);
  const SimulatedDrive after = drive_with("gnss.no_velocity@30+20");
  for (std::size_t i = 0; i < before.gnss.size(); ++i) {
    const double t_s = seconds_between(before.config.start_utime, before.gnss[i].t_us);
    CHECK(after.gnss[i].velocity.has_value() == !test::during_fault(t_s));
    CHECK(after.gnss[i].antenna.latitude == before.gnss[i].antenna.latitude);
  }
}

}  // namespace
}  // namespace roadfix
