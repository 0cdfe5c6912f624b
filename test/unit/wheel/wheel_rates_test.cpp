/// Wheels as buses carry them: fast, or in coarse steps. Between two samples they accelerate by more than a car can.
#include <catch2/catch.hpp>

#include "drive.h"
#include "simulation/scenarios.h"

namespace roadfix {
namespace {

using test::LevelTruth;
using test::matching_config;
using test::run;

struct Told {
  int poses = 0, coasting = 0;
  int beyond = 0;           ///< tilt errors of over three sigma
  double worst_rate = 0.0;  ///< m/s2, between two wheel samples
};

Told drive(double rate_hz, double resolution_mps) {
  ScenarioConfig s = scenario("city_loop");
  s.duration_s = 120.0;
  s.wheels.layout = WheelLayout::kOneSpeed;
  s.wheels.rate_hz = rate_hz;
  s.wheels.resolution_mps = resolution_mps;
  const SimulatedDrive d = simulate(s, 101);
  Told told;
  for (size_t i = 1; i < d.wheels.size(); ++i) {
    const double change = d.wheels[i].speeds[0] - d.wheels[i - 1].speeds[0];
    told.worst_rate =
        std::max(told.worst_rate, std::abs(change) / seconds_between(d.wheels[i - 1].t_us, d.wheels[i].t_us));
  }
  WheelOdometry odometry(matching_config(s));
  LevelTruth truth(d);
  run(d, odometry, [&](const WheelOdometry& o) {
    const Odometry pose = o.odometry();
    if (!truth.started()) truth.start(pose.t_us);
    ++told.poses;
    told.coasting += pose.validity == Validity::kValid ? 0 : 1;
    const Vector6d e = truth.error(pose);
    const auto off = [&](int i) { return std::abs(e(i)) > 3.0 * std::sqrt(pose.cov_pose(i, i)); };
    told.beyond += off(3) || off(4) ? 1 : 0;
  });
  std::printf(
      "wheels at %.0f Hz in steps of %.2f m/s: up to %.1f m/s2 between two; %.2f %% coasting, tilt beyond 3 sigma %.2f "
      "%%\n",
      rate_hz, resolution_mps, told.worst_rate, 100.0 * told.coasting / told.poses, 100.0 * told.beyond / told.poses);
  return told;
}

TEST_CASE("fast wheels and coarse ones neither slip nor tilt the car") {
  for (const auto& [rate_hz, resolution_mps] : {std::pair(20.0, 0.0), std::pair(100.0, 0.0), std::pair(50.0, 0.06),
                                                std::pair(10.0, 1.0 / 3.6), std::pair(50.0, 1.0 / 3.6)}) {
    CAPTURE(rate_hz, resolution_mps);
    const Told told = drive(rate_hz, resolution_mps);
    CHECK(told.coasting < 0.01 * told.poses);
    CHECK(told.beyond < 0.08 * told.poses);
    if (rate_hz > 20.0)
      CHECK(told.worst_rate > 2.0 * WheelTuning{}.tilt_gate);  // taken one by one they would be refused
  }
}

}  // namespace
}  // namespace roadfix
