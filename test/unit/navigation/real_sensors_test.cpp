// What receivers and buses of real cars do to speeds: velocities that come late, speeds in whole km/h.
#include <catch2/catch.hpp>
#include <random>

#include "filter_run.h"

using namespace roadfix;
using namespace roadfix::navtest;

namespace {

struct Errors {
  double horizontal = 0.0, up = 0.0;  ///< m, RMS after half a minute
  std::string gnss_reason;            ///< at the end
};

Errors errors_of(const SimulatedDrive& drive, const NavigationConfig& config, const Samples& samples) {
  Navigation filter(config);
  Errors e;
  int64_t next = drive.imu.front().t_us + 30'000'000;
  int outputs = 0;
  run(filter, samples, [&](Navigation& f, int64_t now) {
    f.clear_records();
    if (now < next) return;
    next += 100'000;
    const Eigen::Matrix<double, 9, 1> error = error_of(f, f.output().imu, drive);
    e.horizontal += error.head<2>().squaredNorm();
    e.up += error.z() * error.z();
    ++outputs;
    e.gnss_reason = f.status().gnss_reason;
  });
  e.horizontal = std::sqrt(e.horizontal / outputs);
  e.up = std::sqrt(e.up / outputs);
  return e;
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
  const Errors in_steps = errors_of(drive, phone_config(drive), samples);
  // Teeth: steps that a dither of a millimetre a second hides.
  std::mt19937 rng(1);
  std::uniform_real_distribution<double> dither(-1e-3, 1e-3);
  for (WheelSample& w : samples.wheels)
    for (double& speed : w.speeds) speed = std::abs(speed + dither(rng));
  const Errors hidden = errors_of(drive, phone_config(drive), samples);
  samples.wheels.clear();
  const Errors without = errors_of(drive, phone_config(drive), samples);
  CAPTURE(in_steps.horizontal, hidden.horizontal, without.horizontal);
  CHECK(in_steps.horizontal < 1.1 * without.horizontal);
  CHECK(hidden.horizontal > 2.0 * without.horizontal);
}

TEST_CASE("velocities that come late are taken for late, and for no antenna elsewhere") {
  ScenarioConfig s = phone_in_city();
  s.wheels.layout = WheelLayout::kNone;
  s.gnss.rate_hz = 10.0;
  int misled = 0;
  for (const double latency : {0.3, -0.3})
    for (const uint64_t seed : {59U, 60U, 61U}) {
      s.gnss.velocity_latency_s = latency;
      const SimulatedDrive drive = simulate(s, seed);
      NavigationConfig config = phone_config(drive);
      config.facts.velocity_latency_std = 0.3;
      const Errors told = errors_of(drive, config, Samples(drive));
      CAPTURE(latency, seed, told.horizontal, told.up, told.gnss_reason);
      CHECK(told.horizontal < 0.05);
      CHECK(told.up < 0.05);
      CHECK(told.gnss_reason.empty());
      // Teeth: taken for velocities of their own moment, of which a low pass makes late ones at most.
      config.facts.velocity_latency_std = 0.0;
      if (latency < 0.0) misled += errors_of(drive, config, Samples(drive)).horizontal > 1.0 ? 1 : 0;
    }
  CHECK(misled >= 2);
}
