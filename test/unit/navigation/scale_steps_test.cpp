// Steps of the wheels' scale before and in a tunnel.
#include <catch2/catch.hpp>
#include <cstdio>

#include "filter_run.h"

using namespace roadfix;
using namespace roadfix::navigation;

namespace {

struct Told {
  double honest = 0.0;  ///< error squared over variance, level
  double error = 0.0;   ///< m, root mean square
  int64_t steps = 0;    ///< that were taken back
};

/// The last seconds of a minute of tunnel, over some drives, with wheels that a fault changes.
Told in_tunnel(const char* fault, bool steps) {
  navtest::LevelScore score;
  int64_t taken_back = 0;
  for (uint64_t seed = 1; seed <= 6; ++seed) {
    ScenarioConfig s = scenario("tunnel_dark");
    s.duration_s = 151.0;
    if (fault != nullptr) s.faults.push_back(parse_fault(fault));
    const SimulatedDrive drive = simulate(s, seed);
    NavigationConfig config = navtest::filter_config(s);
    config.aiding.step_detection = steps;
    Navigation filter(config);
    score.run(filter, drive, 140.0, 150.0);
    taken_back += filter.status().wheel_scale_steps;
  }
  return {score.squares / score.variances, std::sqrt(score.squares / score.scored), taken_back};
}

}  // namespace

TEST_CASE("wheels whose scale steps before a tunnel or in it are found out without GNSS") {
  const Told none = in_tunnel(nullptr, true);
  // At any phase of the moments that the filter compares with each other.
  for (const char* fault :
       {"wheels.scale@85+200:ratio=0.02", "wheels.scale@110.4+200:ratio=0.02", "wheels.scale@85+200:ratio=0.005",
        "wheels.scale@85.25+200:ratio=0.005", "wheels.scale@85.5+200:ratio=0.005", "wheels.scale@85.75+200:ratio=0.005",
        "wheels.scale@110+200:ratio=-0.005", "wheels.scale@110.5+200:ratio=-0.005"}) {
    const Told told = in_tunnel(fault, true), believed = in_tunnel(fault, false);
    std::printf("%s: %.2f m, square over variance %.2f; believed %.2f m, %.1f; without a step %.2f m, %.2f\n", fault,
                told.error, told.honest, believed.error, believed.honest, none.error, none.honest);
    CHECK(told.honest < 2.0);
    CHECK(told.error < 1.75 * none.error);
    CHECK(told.steps >= 5);        // one in each drive, but for a small one of a drive
    CHECK(believed.honest > 2.5);  // teeth
  }
}

TEST_CASE("where no scale steps the wheels are not doubted, also not noisier ones") {
  const Told none = in_tunnel(nullptr, true), unasked = in_tunnel(nullptr, false);
  CHECK(none.error < 1.02 * unasked.error);  // the fixes under the bridge are displaced: found, and taken back
  CHECK(none.steps == 0);
  const Told noisy = in_tunnel("wheels.noise@60+200:factor=2", true);
  CHECK(noisy.honest < 1.25);
}
