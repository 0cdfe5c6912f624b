// Aligned again within a drive: what the receiver has shown, and that it may come back displaced, still hold.
#include <catch2/catch.hpp>
#include <cstdio>

#include "filter_run.h"

using namespace roadfix;

namespace {

/// Over some drives through the bridge and the tunnel, the IMU is silent for three seconds from `hole_s` on; scored
/// from `from_s` to `to_s`.
test::LevelScore after_hole(double hole_s, double from_s, double to_s, const std::function<void(GnssInsConfig&)>& set) {
  test::LevelScore score;
  for (uint64_t seed = 1; seed <= 8; ++seed) {
    ScenarioConfig s = scenario("tunnel_dark");
    s.duration_s = to_s + 1.0;
    char fault[64];
    (void)std::snprintf(fault, sizeof fault, "imu.silence@%g+3", hole_s);
    s.faults.push_back(parse_fault(fault));
    const SimulatedDrive drive = simulate(s, seed);
    GnssInsConfig config = test::filter_config(s);
    set(config);
    GnssIns filter(config);
    score.run(filter, drive, from_s, to_s);
    CHECK(filter.output().reset_counter == 1);
  }
  return score;
}

}  // namespace

TEST_CASE("a start from the first fixes after a tunnel takes them for displaced") {
  const auto held = after_hole(100.0, 165.0, 195.0, [](GnssInsConfig&) {});
  const auto trusting = after_hole(100.0, 165.0, 195.0, [](GnssInsConfig& c) { c.aiding.use_return_error = false; });
  std::printf("aligned again after a tunnel: square over variance %.2f, rms %.3f m; trusting %.1f, %.3f m\n",
              held.squares / held.variances, std::sqrt(held.squares / held.scored),
              trusting.squares / trusting.variances, std::sqrt(trusting.squares / trusting.scored));
  CHECK(held.squares < 1.5 * held.variances);
  CHECK(std::sqrt(held.squares / held.scored) < 0.3);
  CHECK(trusting.squares > 5.0 * trusting.variances);  // teeth
}

TEST_CASE("a start among fixes that have shown to claim too much does not believe their claim") {
  const auto held = after_hole(85.0, 90.0, 100.0, [](GnssInsConfig&) {});
  const auto trusting = after_hole(
      85.0, 90.0, 100.0, [](GnssInsConfig& c) { c.aiding.use_error_correlation = c.aiding.use_lasting_error = false; });
  std::printf("aligned again under a bridge: square over variance %.2f; trusting %.2f\n", held.squares / held.variances,
              trusting.squares / trusting.variances);
  CHECK(held.squares < 5.0 * held.variances);
  CHECK(trusting.squares > 7.0 * trusting.variances);  // teeth
}
