/// Wheel speeds at a high rate or quantised: differences of single samples exceed the acceleration of a car.
#include <catch2/catch.hpp>

#include "drive.h"
#include "simulation/scenarios.h"

namespace roadfix {
namespace {

using test::LevelTruth;
using test::matching_config;
using test::run;

struct RateStatistics {
  int poses = 0, coasting = 0;
  int beyond = 0;           ///< tilt errors above three sigma
  double worst_rate = 0.0;  ///< m/s2, between two wheel samples
};

RateStatistics drive(double rate_hz, double resolution_mps) {
  ScenarioConfig s = scenario("city_loop");
  s.duration_s = 120.0;
  s.wheels.layout = WheelLayout::kOneSpeed;
  s.wheels.rate_hz = rate_hz;
  s.wheels.resolution_mps = resolution_mps;
  const SimulatedDrive d = simulate(s, 101);
  RateStatistics result;
  for (size_t i = 1; i < d.wheels.size(); ++i) {
    const double change = d.wheels[i].speeds[0] - d.wheels[i - 1].speeds[0];
    result.worst_rate =
        std::max(result.worst_rate, std::abs(change) / seconds_between(d.wheels[i - 1].t_us, d.wheels[i].t_us));
  }
  WheelOdometry odometry(matching_config(s));
  LevelTruth truth(d);
  run(d, odometry, [&](const WheelOdometry& o) {
    const Odometry pose = o.odometry();
    if (!truth.started()) truth.start(pose.t_us);
    ++result.poses;
    result.coasting += pose.validity == Validity::kValid ? 0 : 1;
    const Vector6d e = truth.error(pose);
    const auto off = [&](int i) { return std::abs(e(i)) > 3.0 * std::sqrt(pose.cov_pose(i, i)); };
    result.beyond += off(3) || off(4) ? 1 : 0;
  });
  std::printf(
      "wheels at %.0f Hz in steps of %.2f m/s: up to %.1f m/s2 between two; %.2f %% coasting, tilt beyond 3 sigma %.2f "
      "%%\n",
      rate_hz, resolution_mps, result.worst_rate, 100.0 * result.coasting / result.poses,
      100.0 * result.beyond / result.poses);
  return result;
}

TEST_CASE("high-rate and quantised wheel speeds cause neither slip nor tilt errors") {
  for (const auto& [rate_hz, resolution_mps] : {std::pair(20.0, 0.0), std::pair(100.0, 0.0), std::pair(50.0, 0.06),
                                                std::pair(10.0, 1.0 / 3.6), std::pair(50.0, 1.0 / 3.6)}) {
    CAPTURE(rate_hz, resolution_mps);
    const RateStatistics result = drive(rate_hz, resolution_mps);
    CHECK(result.coasting < 0.01 * result.poses);
    CHECK(result.beyond < 0.08 * result.poses);
    if (rate_hz > 20.0)
      CHECK(result.worst_rate > 2.0 * WheelTuning{}.tilt_gate);  // single differences would be rejected
  }
}

}  // namespace
}  // namespace roadfix
