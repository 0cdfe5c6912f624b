#include <catch2/catch.hpp>
#include <cstring>
#include <vector>

#include "simulation/scenarios.h"
#include "simulation/simulate.h"

namespace roadfix {
namespace {

std::vector<double> numbers(const std::vector<ImuSample>& samples) {
  std::vector<double> out;
  for (const ImuSample& s : samples) {
    out.insert(out.end(), s.gyro.begin(), s.gyro.end());
    out.insert(out.end(), s.accel.begin(), s.accel.end());
  }
  return out;
}

std::vector<double> numbers(const std::vector<GnssFix>& fixes) {
  std::vector<double> out;
  for (const GnssFix& f : fixes) {
    out.insert(out.end(), {f.antenna.latitude, f.antenna.longitude, f.antenna.height});
    if (f.velocity) out.insert(out.end(), f.velocity->enu.begin(), f.velocity->enu.end());
  }
  return out;
}

std::vector<double> numbers(const std::vector<WheelSample>& samples) {
  std::vector<double> out;
  for (const WheelSample& s : samples) out.insert(out.end(), s.speeds.begin(), s.speeds.end());
  return out;
}

std::vector<double> numbers(const std::vector<MagSample>& samples) {
  std::vector<double> out;
  for (const MagSample& s : samples) out.insert(out.end(), s.field.begin(), s.field.end());
  return out;
}

template <class Samples>
bool same_bytes(const Samples& a, const Samples& b) {
  const std::vector<double> x = numbers(a);
  const std::vector<double> y = numbers(b);
  return x.size() == y.size() && std::memcmp(x.data(), y.data(), x.size() * sizeof(double)) == 0;
}

TEST_CASE("the same seed gives the same bytes and another seed does not") {
  const ScenarioConfig config = scenario("city_loop");
  const SimulatedDrive a = simulate(config, 7);
  const SimulatedDrive b = simulate(config, 7);
  const SimulatedDrive c = simulate(config, 8);
  CHECK(same_bytes(a.imu, b.imu));
  CHECK(same_bytes(a.gnss, b.gnss));
  CHECK(same_bytes(a.wheels, b.wheels));
  CHECK(same_bytes(a.mag, b.mag));
  CHECK_FALSE(same_bytes(a.imu, c.imu));
  CHECK_FALSE(same_bytes(a.gnss, c.gnss));
  CHECK_FALSE(same_bytes(a.wheels, c.wheels));
  CHECK_FALSE(same_bytes(a.mag, c.mag));
}

TEST_CASE("one sensor's noise does not change another's numbers") {
  ScenarioConfig config = scenario("city_loop");
  const SimulatedDrive before = simulate(config, 7);
  config.gnss.multipath_sigma_m = 3.0;
  config.gnss.rate_hz = 1.0;
  config.wheels.layout = WheelLayout::kOneSpeed;
  config.imu.gyro_scale_std = 0.0;
  config.mag.noise_ut = 2.0;
  const SimulatedDrive after = simulate(config, 7);
  CHECK_FALSE(same_bytes(before.gnss, after.gnss));
  CHECK_FALSE(same_bytes(before.mag, after.mag));
  for (std::size_t i = 0; i < before.imu.size(); ++i) REQUIRE(before.imu[i].accel == after.imu[i].accel);
  CHECK(before.errors.imu_bias[0].gyro == after.errors.imu_bias[0].gyro);
  CHECK(before.errors.hard_iron == after.errors.hard_iron);
  CHECK(before.errors.q_vehicle_imu.coeffs() == after.errors.q_vehicle_imu.coeffs());
}

}  // namespace
}  // namespace roadfix
