// What buses of real cars do to speeds: whole km/h.
#include <catch2/catch.hpp>
#include <random>

#include "filter_run.h"

using namespace roadfix;
using namespace roadfix::navtest;

namespace {

/// m, horizontal RMS after half a minute.
double error_over(const SimulatedDrive& drive, const NavigationConfig& config, const Samples& samples) {
  Navigation filter(config);
  double sum = 0.0;
  int64_t next = drive.imu.front().t_us + 30'000'000;
  int outputs = 0;
  run(filter, samples, [&](Navigation& f, int64_t now) {
    f.clear_records();
    if (now < next) return;
    next += 100'000;
    sum += error_of(f, f.output().odometry, drive).head<2>().squaredNorm();
    ++outputs;
  });
  return std::sqrt(sum / outputs);
}

/// A phone's imu, mounted by hand, beside fixed fixes.
ScenarioConfig phone_in_city() {
  ScenarioConfig s = scenario("city_loop");
  s.duration_s = 120.0;
  s.imu.gyro_noise_radps_per_rthz = 7e-4;
  s.imu.accel_noise_mps2_per_rthz = 3e-3;
  s.imu.gyro_bias_std_radps = 0.04;
  s.imu.accel_bias_std_mps2 = 0.15;
  s.imu.mounting_std_rad.setConstant(0.05);
  return s;
}

/// The antenna's place is told in the imu's own axes, however the imu is turned.
NavigationConfig phone_config(const SimulatedDrive& drive) {
  NavigationConfig config = filter_config(drive.config);
  config.facts.p_imu_antenna = drive.errors.q_vehicle_imu.conjugate() * config.facts.p_imu_antenna;
  return config;
}

}  // namespace

TEST_CASE("speeds in whole km/h do not make a filter contradict good fixes") {
  ScenarioConfig s = phone_in_city();
  s.wheels.rate_hz = 50.0;
  s.wheels.signs = WheelSigns::kUnsigned;
  s.wheels.resolution_mps = 1.0 / 3.6;
  s.wheels.speed_scale_std = 0.002;
  s.gnss.sigma_velocity_mps = 0.24;
  const SimulatedDrive drive = simulate(s, 27);
  Samples samples(drive);
  const double in_steps = error_over(drive, phone_config(drive), samples);
  // Teeth: steps that a dither of a millimetre a second hides.
  std::mt19937 rng(1);
  std::uniform_real_distribution<double> dither(-1e-3, 1e-3);
  for (WheelSample& w : samples.wheels)
    for (double& speed : w.speeds) speed = std::abs(speed + dither(rng));
  const double hidden = error_over(drive, phone_config(drive), samples);
  samples.wheels.clear();
  const double without = error_over(drive, phone_config(drive), samples);
  CAPTURE(in_steps, hidden, without);
  CHECK(in_steps < 1.1 * without);
  CHECK(hidden > 2.0 * without);
}
