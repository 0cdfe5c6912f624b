// What a calibration says, or does not say, of how old GNSS values are at their stamps, and of how biases walk.
#include <catch2/catch.hpp>
#include <cstdio>

#include "gnss_ins_ekf/messages.h"
#include "gnss_ins_ekf/vehicle_facts.h"
#include "navigation/process_model.h"
#include "unit/navigation/filter_run.h"

using namespace roadfix;

namespace {

/// Share of the level errors within three of their sigmas, after a minute, where the filter believes of time what this
/// calibration makes of it.
double honest_share(const Calibration& calibration, const ScenarioConfig& s) {
  navtest::LevelScore score;
  for (uint64_t seed = 1; seed <= 4; ++seed) {
    const SimulatedDrive drive = simulate(s, seed);
    navigation::NavigationConfig config = navtest::filter_config(s);
    const navigation::VehicleFacts said = vehicle_facts(calibration);
    config.facts.position_latency_std = said.position_latency_std;
    config.facts.velocity_latency_std = said.velocity_latency_std;
    config.facts.time_offset_std = said.time_offset_std;
    config.facts.wheel_latency_std = said.wheel_latency_std;
    config.aiding.step_detection = false;  // it finds clocks that were called exact, too
    navigation::Navigation filter(config);
    score.run(filter, drive, 60.0, s.duration_s);
  }
  return score.share();
}

/// What is wrong with this drive's times is found where a calibration is silent of it; one that calls them exact, the
/// teeth, is not honest there.
void check_found_out(const char* wrong, const ScenarioConfig& s, const Calibration& silent, const Calibration& exact) {
  const double found = honest_share(silent, s), denied = honest_share(exact, s);
  std::printf("%s: within three sigma %.3f, called exact %.3f\n", wrong, found, denied);
  CHECK(found > 0.99);
  CHECK(denied < 0.9);
}

ScenarioConfig short_city_loop() {
  ScenarioConfig s = scenario("city_loop");
  s.duration_s = 110.0;
  return s;
}

}  // namespace

TEST_CASE("a calibration that is silent about latencies does not claim to know them") {
  Calibration silent, exact;
  exact.sensors.gnss.emplace().position_latency_std = 0.0;
  CHECK(vehicle_facts(silent).position_latency_std == 0.05);
  CHECK(vehicle_facts(silent).velocity_latency_std == 0.05);
  CHECK(vehicle_facts(exact).position_latency_std == 0.0);
  CHECK(vehicle_facts(exact).velocity_latency_std == 0.0);
  exact.sensors.gnss->velocity_latency_std = 0.2;
  CHECK(vehicle_facts(exact).velocity_latency_std == 0.2);
}

TEST_CASE("a calibration that is silent about the IMU's clock does not claim to know it") {
  Calibration calibration;
  CHECK(vehicle_facts(calibration).time_offset_std == 0.0);  // the latency's doubt has it
  calibration.sensors.gnss.emplace().position_latency_std = 0.0;
  CHECK(vehicle_facts(calibration).time_offset_std == 0.05);
  calibration.sensors.imu.emplace();
  CHECK(vehicle_facts(calibration).time_offset_std == 0.05);
  calibration.sensors.imu->time_offset_std = 0.0;
  CHECK(vehicle_facts(calibration).time_offset_std == 0.0);
}

TEST_CASE("fixes 80 ms old are found to be so where the calibration is silent") {
  ScenarioConfig late = short_city_loop();
  late.gnss.position_latency_s = late.gnss.velocity_latency_s = 0.08;
  Calibration silent, exact;
  exact.sensors.gnss.emplace().position_latency_std = 0.0;
  exact.sensors.imu.emplace().time_offset_std = 0.0;
  check_found_out("fixes 80 ms old", late, silent, exact);
}

TEST_CASE("an IMU whose stamps are 80 ms ahead is found to be so where the calibration is silent of its clock") {
  ScenarioConfig ahead = short_city_loop();
  ahead.imu.link.clock_offset_s = 0.08;
  Calibration silent;
  silent.sensors.gnss.emplace().position_latency_std = 0.0;
  Calibration exact = silent;
  exact.sensors.imu.emplace().time_offset_std = 0.0;
  check_found_out("an IMU 80 ms ahead", ahead, silent, exact);
}

TEST_CASE("wheel speeds 50 ms old are found to be so where the calibration is silent of their age") {
  ScenarioConfig late = short_city_loop();
  late.wheels.link.clock_offset_s = 0.05;
  Calibration silent;
  silent.sensors.gnss.emplace().position_latency_std = 0.0;
  silent.sensors.imu.emplace().time_offset_std = 0.0;
  silent.sensors.wheels.emplace();
  Calibration exact = silent;
  exact.sensors.wheels->latency_std = 0.0;
  check_found_out("wheel speeds 50 ms old", late, silent, exact);
}

TEST_CASE("INS_STATUS tells how old wheel speeds are, and how far the IMU's clock is off") {
  ScenarioConfig s = short_city_loop();
  s.wheels.link.clock_offset_s = 0.05;
  s.imu.link.clock_offset_s = -0.03;
  const SimulatedDrive drive = simulate(s, 1);
  navigation::NavigationConfig config = navtest::filter_config(s);
  config.facts.time_offset_std = config.facts.wheel_latency_std = 0.05;
  navigation::Navigation filter(config);
  navtest::run(filter, navtest::Samples(drive), [](navigation::Navigation& f, int64_t) { f.clear_records(); });
  const ins_status_t told = ins_status(filter.status(), filter.filter(), config.facts, Eigen::Quaterniond::Identity());
  CHECK(told.wheel_latency_std_s < 0.01);
  CHECK(std::abs(told.wheel_latency_s - 0.05) < 3.0 * told.wheel_latency_std_s);
  CHECK(told.imu_time_offset_std_s < 0.02);
  CHECK(std::abs(told.imu_time_offset_s + 0.03) < 3.0 * told.imu_time_offset_std_s);
  CHECK(std::abs(told.imu_time_offset_s) > 3.0 * told.imu_time_offset_std_s);  // teeth: nought would not do
  CHECK(told.wheel_scale_steps == 0);
}

TEST_CASE("the accelerometer's biases walk by their own correlation time, and by the gyro's where it is not told") {
  Calibration c;
  ImuCalibration& imu = c.sensors.imu.emplace();
  imu.gyro_bias_std = 1e-3;
  imu.accel_bias_std = 0.03;
  imu.correlation = 600.0;
  constexpr double kStep = 0.05;  // s
  const auto walk = [&](int at) {
    navigation::NavigationConfig config;
    const navigation::VehicleFacts said = vehicle_facts(c);
    config.facts.gyro_bias_std = said.gyro_bias_std;
    config.facts.accel_bias_std = said.accel_bias_std;
    config.facts.correlation_s = said.correlation_s;
    config.facts.accel_correlation_s = said.accel_correlation_s;
    return navigation::ProcessModel(config).over(kStep, navigation::State(false), true).noise(at);
  };
  CHECK(walk(navigation::kAccelBias) == Approx(2.0 * kStep * 0.03 * 0.03 / 600.0));
  imu.accel_correlation = 6e6;
  CHECK(walk(navigation::kAccelBias) == Approx(2.0 * kStep * 0.03 * 0.03 / 6e6));
  CHECK(walk(navigation::kGyroBias) == Approx(2.0 * kStep * 1e-3 * 1e-3 / 600.0));
}
