#include "wheel/wheel_odometry.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "drive.h"
#include "geodesy/gravity.h"
#include "geometry/euler.h"
#include "geometry/frames.h"
#include "simulation/scenarios.h"

namespace roadfix {

using namespace wheel;  // indices of the error state
namespace {

using test::LevelTruth;
using test::matching_config;
using test::run;

ScenarioConfig scenario_of(const char* name, double duration_s) {
  ScenarioConfig s = scenario(name);
  s.duration_s = duration_s;
  return s;
}

/// Same motion, sensors without errors.
ScenarioConfig perfect(ScenarioConfig s) {
  s.imu.gyro_noise_radps_per_rthz = s.imu.accel_noise_mps2_per_rthz = 0.0;
  s.imu.gyro_bias_std_radps = s.imu.accel_bias_std_mps2 = 0.0;
  s.imu.gyro_bias_drift_std_radps = s.imu.accel_bias_drift_std_mps2 = 0.0;
  s.imu.gyro_scale_std = s.imu.accel_scale_std = 0.0;
  s.wheels.speed_scale_std = s.wheels.wheel_scale_std = s.wheels.speed_noise_mps = 0.0;
  return s;
}

/// The odometry estimates the Earth's rate as gyro bias; here it would hide the effect under test.
void remove_earth_rate(SimulatedDrive& drive) {
  for (ImuSample& imu : drive.imu)
    imu.gyro -= drive.truth_at(imu.t_us).T_frame_vehicle.q.conjugate() * earth_rate_enu(drive.anchor);
}

double distance_driven(const SimulatedDrive& drive) {
  double d = 0.0;
  for (std::size_t i = 1; i < drive.truth.size(); ++i)
    d += (drive.truth[i].T_frame_vehicle.p - drive.truth[i - 1].T_frame_vehicle.p).norm();
  return d;
}

TEST_CASE("ideal sensors: position error below 0.1 % of the distance") {
  for (const char* name : {"city_loop", "car_park"}) {
    const ScenarioConfig s = perfect(scenario_of(name, 120.0));
    SimulatedDrive drive = simulate(s, 1);
    remove_earth_rate(drive);
    const Vector6d error = test::end_error(drive, matching_config(scenario(name))).error;
    INFO(name << ": " << error.transpose() << " over " << distance_driven(drive));
    CHECK(error.head<2>().norm() < 1.5e-3 * distance_driven(drive));
    CHECK(std::abs(error.z()) < 5e-3 * distance_driven(drive));
    CHECK(error.tail<3>().norm() < 0.5 * kDegree);
  }
}

TEST_CASE("uncorrected accelerometer angles tilt under braking, corrected ones do not") {
  const ScenarioConfig s = perfect(scenario_of("city_loop", 90.0));
  const SimulatedDrive drive = simulate(s, 1);
  const auto rms_pitch = [&](bool correct) {
    WheelConfig config = matching_config(scenario("city_loop"));
    config.tuning.correct_acceleration = correct;
    WheelOdometry odometry(config);
    double sum = 0.0;
    int count = 0;
    run(drive, odometry, [&](const WheelOdometry& o) {
      const double pitch = yaw_pitch_roll(drive.truth_at(o.odometry().t_us).T_frame_vehicle.q).pitch;
      sum += std::pow(o.state().x(kPitch) - pitch, 2);
      ++count;
    });
    return std::sqrt(sum / count);
  };
  const double corrected = rms_pitch(true), plain = rms_pitch(false);
  CHECK(corrected < 0.3 * kDegree);
  CHECK(plain > 5.0 * corrected);
}

TEST_CASE("standstill: position and yaw are constant to the bit, the gyro bias is estimated") {
  ScenarioConfig s = scenario_of("standing", 60.0);
  s.imu.gyro_bias_std_radps = 0.02;
  const SimulatedDrive drive = simulate(s, 3);
  WheelOdometry odometry(matching_config(s));
  std::optional<WheelState> stood;
  run(drive, odometry, [&](const WheelOdometry& o) {
    if (!stood && o.report().standing) stood = o.state();
    if (!stood) return;
    REQUIRE(o.state().x.segment<3>(kPos) == stood->x.segment<3>(kPos));
    REQUIRE(o.state().x(kYaw) == stood->x(kYaw));
  });
  REQUIRE(stood);
  CHECK(stood->x.segment<3>(kPos).norm() < 0.1);
  const Eigen::Vector3d bias_error = odometry.state().x.segment<3>(kGyroBias) - drive.errors.imu_bias.back().gyro;
  CHECK(bias_error.norm() < 3e-4);  // the Earth's rate, 7e-5, is estimated with the bias
  CHECK(drive.errors.imu_bias.back().gyro.norm() > 5e-3);
}

/// Wheels at rest while the gyro measures `rate` about z for `duration_s`; gyro_bias_std as calibrated.
WheelState turned_on_the_spot(double rate, double gyro_bias_std, double duration_s) {
  WheelConfig config;
  config.sensors.gyro_bias_std = gyro_bias_std;
  config.sensors.gyro_noise = 3e-5;
  WheelOdometry odometry(config);
  for (int64_t i = 0; i <= static_cast<int64_t>(duration_s * 100.0); ++i) {
    ImuSample imu;
    imu.t_us = 10'000 * i;
    imu.gyro.z() = rate;
    imu.accel.z() = kStandardGravity;
    (void)odometry.add(imu);
    WheelSample wheels;
    wheels.t_us = imu.t_us;
    if (i % 10 == 0) (void)odometry.add(wheels);
  }
  REQUIRE(odometry.report().standing);
  return odometry.state();
}

TEST_CASE("a rate beyond the plausible gyro bias is turning, although the wheels stand") {
  const double rate = 7.6e-4;
  const WheelState turned = turned_on_the_spot(rate, 1.2e-4, 35.0);
  CHECK(turned.x(kYaw) == Approx(rate * 33.0).margin(rate * 2.0));
  CHECK(std::abs(turned.x(kGyroBias + 2)) < 1e-5);
  CHECK(turned.sigma(kGyroBias + 2) > 1e-4);
  CHECK(turned.x.segment<3>(kPos).norm() < 1e-9);
  // A plausible rate is the bias, and the yaw is unchanged.
  const WheelState stood = turned_on_the_spot(rate, 5e-3, 35.0);
  CHECK(stood.x(kGyroBias + 2) == Approx(rate).epsilon(0.01));
  CHECK(std::abs(stood.x(kYaw)) < rate * 2.0);
}

TEST_CASE("reversing: signed speed, gear and magnitude give the same end position") {
  for (const WheelSigns signs : {WheelSigns::kSigned, WheelSigns::kGear, WheelSigns::kUnsigned}) {
    ScenarioConfig s = scenario_of("car_park", 120.0);
    s.wheels.signs = signs;
    const SimulatedDrive drive = simulate(s, 5);
    bool reversed = false;
    for (const Odometry& t : drive.truth) reversed = reversed || t.velocity.x() < -0.5;
    REQUIRE(reversed);
    const test::EndError end = test::end_error(drive, matching_config(s));
    INFO("signs " << static_cast<int>(signs) << " error " << end.error.transpose());
    CHECK(end.error.head<2>().norm() < 0.03 * distance_driven(drive));
    CHECK(end.error.head<2>().norm() < 4.0 * std::sqrt(end.cov(0, 0) + end.cov(1, 1)));
  }
}

TEST_CASE("teeth: reverse taken for forward ends elsewhere") {
  ScenarioConfig s = scenario_of("car_park", 120.0);
  s.wheels.signs = WheelSigns::kUnsigned;
  SimulatedDrive drive = simulate(s, 5);
  for (WheelSample& w : drive.wheels) w.direction = WheelDirection::kForward;
  CHECK(test::end_error(drive, matching_config(s)).error.head<2>().norm() > 0.1 * distance_driven(drive));
}

/// Wheels spin up by 4 m/s for 1.5 s in the middle of a drive.
SimulatedDrive slipping_drive(const ScenarioConfig& s) {
  SimulatedDrive drive = simulate(s, 7);
  const int64_t begin = s.start_utime + 20'000'000, end = begin + 1'500'000;
  for (WheelSample& w : drive.wheels)
    if (w.t_us > begin && w.t_us < end)
      for (double& v : w.speeds) v += 4.0;
  return drive;
}

TEST_CASE("wheel spin is rejected, reported and increases the covariance") {
  const ScenarioConfig s = scenario_of("city_loop", 40.0);
  const SimulatedDrive good = simulate(s, 7), bad = slipping_drive(s);
  int slipping = 0;
  double largest_sigma = 0.0;
  Validity worst = Validity::kValid;
  WheelOdometry odometry(matching_config(s));
  run(bad, odometry, [&](const WheelOdometry& o) {
    if (!o.report().slipping) return;
    ++slipping;
    largest_sigma = std::max(largest_sigma, o.state().sigma(kSpeed));
    worst = std::min(worst, o.report().validity);
    CHECK(o.report().reason == "wheels slip: speed from the accelerometer");
  });
  CHECK(slipping > 100);
  CHECK(slipping < 300);
  CHECK(worst == Validity::kCoasting);
  CHECK(largest_sigma > 0.03);
  CHECK(!odometry.report().slipping);
  const auto travelled_error = [&](const SimulatedDrive& d, double gate) {
    WheelConfig config = matching_config(s);
    config.tuning.slip_gate = gate;
    return test::end_error(d, config).error.head<2>().norm();
  };
  CHECK(travelled_error(bad, 5.0) < travelled_error(good, 5.0) + 0.5);
  CHECK(travelled_error(bad, 1000.0) > 4.0);  // used, the slip would be 6 m
}

TEST_CASE("without IMU four wheels propagate alone and report it") {
  ScenarioConfig s = scenario_of("city_loop", 60.0);
  s.wheels.wheel_scale_std = 1e-4;  // 0.1 % between left and right is half a radian per minute
  SimulatedDrive drive = simulate(s, 9);
  drive.imu.clear();
  WheelConfig config = matching_config(s);
  config.sensors.wheel_yaw_noise = s.wheels.speed_noise_mps * std::sqrt(2.0) / s.wheels.track_width_m;
  config.sensors.wheel_yaw_bias_std = 1e-3;
  WheelOdometry odometry(config);
  LevelTruth truth(drive);
  run(drive, odometry, [&](const WheelOdometry& o) {
    if (!truth.started()) truth.start(o.odometry().t_us);
  });
  CHECK(odometry.report().phase == WheelPhase::kWeak);
  CHECK(odometry.report().reason == "no imu: level road assumed, yaw rate from the wheels");
  const Odometry end = odometry.odometry();
  const Vector6d error = truth.error(end);
  CHECK(error.head<2>().norm() < 0.1 * distance_driven(drive));
  CHECK(error.head<2>().norm() < 3.5 * std::sqrt(end.cov_pose(0, 0) + end.cov_pose(1, 1)));
}

TEST_CASE("missing inputs are reported") {
  const ScenarioConfig s = scenario_of("city_loop", 30.0);
  const SimulatedDrive drive = simulate(s, 11);
  WheelOdometry no_wheels(matching_config(s)), outage(matching_config(s)), no_imu(matching_config(s));
  for (const ImuSample& imu : drive.imu) (void)no_wheels.add(imu);
  CHECK(no_wheels.report().phase == WheelPhase::kWaiting);
  CHECK(no_wheels.report().reason == "waits for wheels");
  CHECK(no_wheels.odometry().validity == Validity::kInvalid);

  SimulatedDrive cut = drive;
  std::erase_if(cut.wheels, [&](const WheelSample& w) { return w.t_us > s.start_utime + 15'000'000; });
  double sigma_early = 0.0;
  run(cut, outage, [&](const WheelOdometry& o) {
    if (o.odometry().t_us < s.start_utime + 15'000'000) sigma_early = o.state().sigma(kSpeed);
  });
  CHECK(outage.report().validity != Validity::kValid);
  CHECK(outage.report().reason.find("no wheels") == 0);
  CHECK(outage.state().sigma(kSpeed) > 5.0 * sigma_early);

  SimulatedDrive one_speed = drive;
  one_speed.imu.clear();
  for (WheelSample& w : one_speed.wheels) w.num_speeds = 1;
  run(one_speed, no_imu, [](const WheelOdometry&) {});
  CHECK(no_imu.report().reason.find("no yaw rate") == 0);
}

TEST_CASE("invalid and repeated samples change nothing") {
  const ScenarioConfig s = scenario_of("city_loop", 5.0);
  const SimulatedDrive drive = simulate(s, 13);
  WheelOdometry odometry(matching_config(s));
  run(drive, odometry, [](const WheelOdometry&) {});
  const WheelState before = odometry.state();
  ImuSample imu = drive.imu.back();
  CHECK(odometry.add(imu) == WheelInputStatus::kOld);
  imu.t_us += 10'000;
  imu.gyro.x() = std::nan("");
  CHECK(odometry.add(imu) == WheelInputStatus::kBadValue);
  WheelSample wheels = drive.wheels.back();
  CHECK(odometry.add(wheels) == WheelInputStatus::kOld);
  wheels.t_us += 100'000;
  wheels.speeds[2] = INFINITY;
  CHECK(odometry.add(wheels) == WheelInputStatus::kBadValue);
  CHECK(odometry.state().x == before.x);
  CHECK(odometry.state().P == before.P);
}

TEST_CASE("a restored snapshot continues with the same bits") {
  const ScenarioConfig s = scenario_of("city_loop", 30.0);
  const SimulatedDrive drive = simulate(s, 15);
  WheelOdometry whole(matching_config(s));
  std::vector<uint8_t> snapshot;
  const int64_t half = s.start_utime + 15'000'000;
  run(drive, whole, [&](const WheelOdometry& o) {
    if (o.odometry().t_us != half) return;
    StateWriter writer;
    o.save(writer);
    snapshot = writer.take();
  });
  REQUIRE(!snapshot.empty());
  WheelOdometry resumed(matching_config(s));
  StateReader reader(snapshot);
  resumed.load(reader);
  reader.finish();
  SimulatedDrive rest = drive;
  std::erase_if(rest.imu, [&](const ImuSample& i) { return i.t_us <= half; });
  std::erase_if(rest.wheels, [&](const WheelSample& w) { return w.t_us < half; });
  std::erase_if(rest.mag, [&](const MagSample& m) { return m.t_us < half; });
  run(rest, resumed, [](const WheelOdometry&) {});
  CHECK(resumed.state().x == whole.state().x);
  CHECK(resumed.state().P == whole.state().P);
}

TEST_CASE("a start in motion uses the gyro bias of the last drive, after the start it has no effect") {
  double with = 0.0, without = 0.0;
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const ScenarioConfig s = scenario_of("city_loop", 100.0);
    const SimulatedDrive drive = simulate(s, seed);
    WheelOdometry first(matching_config(s));
    REQUIRE_FALSE(first.memory());
    run(drive, first, [](const WheelOdometry&) {});
    const std::optional<WheelMemory> memory = first.memory();
    REQUIRE(memory);
    SimulatedDrive rest = drive;  // the same sensors, switched on while the car drives
    const int64_t from_us = drive.imu.front().t_us + 50'000'000;
    std::erase_if(rest.imu, [&](const ImuSample& x) { return x.t_us < from_us; });
    std::erase_if(rest.wheels, [&](const WheelSample& x) { return x.t_us < from_us; });
    std::erase_if(rest.mag, [&](const MagSample& x) { return x.t_us < from_us; });
    for (const bool recalls : {false, true}) {
      WheelOdometry odometry(matching_config(s));
      if (recalls) odometry.restore(*memory);
      LevelTruth truth(rest);
      run(rest, odometry, [&](const WheelOdometry& o) {
        if (!truth.started()) truth.start(o.odometry().t_us);
      });
      (recalls ? with : without) += std::abs(truth.error(odometry.odometry())(5));
      const WheelState before = odometry.state();
      odometry.restore({Eigen::Vector3d::Ones(), Eigen::Vector3d::Ones()});
      CHECK(odometry.state().x == before.x);
    }
  }
  INFO("yaw error at the end, rad: with " << with << ", without " << without);
  CHECK(with < 0.5 * without);
}

TEST_CASE("shifted times give the same bits") {
  const ScenarioConfig s = scenario_of("city_loop", 20.0);
  const SimulatedDrive drive = simulate(s, 17);
  SimulatedDrive shifted = drive;
  constexpr int64_t kShift = 86'400'000'003;
  for (ImuSample& i : shifted.imu) i.t_us += kShift;
  for (WheelSample& w : shifted.wheels) w.t_us += kShift;
  for (MagSample& m : shifted.mag) m.t_us += kShift;
  WheelOdometry a(matching_config(s)), b(matching_config(s));
  run(drive, a, [](const WheelOdometry&) {});
  run(shifted, b, [](const WheelOdometry&) {});
  CHECK(a.state().x == b.state().x);
  CHECK(a.odometry().t_us + kShift == b.odometry().t_us);
}

TEST_CASE("magnetic heading bounds the yaw drift of a poor gyro") {
  ScenarioConfig s = scenario_of("city_loop", 120.0);
  s.imu.gyro_noise_radps_per_rthz = 5e-3;
  s.mag.hard_iron_std_ut = 0.1;
  s.mag.soft_iron_std = 0.001;
  double with = 0.0, without = 0.0;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const SimulatedDrive drive = simulate(s, seed);
    WheelConfig config = matching_config(s);
    config.tuning.mag_noise = 0.02;
    config.tuning.mag_interval = 1.0;
    without += std::pow(test::end_error(drive, config).error(5), 2);
    config.tuning.use_mag = true;
    with += std::pow(test::end_error(drive, config).error(5), 2);
  }
  CHECK(with < 0.25 * without);
}

}  // namespace
}  // namespace roadfix
