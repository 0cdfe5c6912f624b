// What a receiver brings back from an outage: displaced fixes that fade, good ones, and a new start among them.
#include <catch2/catch.hpp>
#include <cstdio>

#include "filter_run.h"

using namespace roadfix;
using namespace roadfix::navtest;

namespace {

struct Return {
  double honest = 0.0;  ///< share of the level errors within three of their sigmas, over 20 s after the tunnel
  double error = 0.0;   ///< m, root mean square of the level errors over the same time
  double sigma = 0.0;   ///< m, likewise of what is claimed
};

/// A bridge and a minute of tunnel; the fixes after it are off by `reacquire` (nothing: as good as before) and do not
/// say so.
Return return_from_tunnel(const char* reacquire, FixType type, double sigma_m, bool expects) {
  LevelScore score;
  for (uint64_t seed = 1; seed <= 6; ++seed) {
    ScenarioConfig s = scenario("tunnel_dark");
    s.duration_s = 172.0;
    s.gnss.fix_type = type;
    s.gnss.sigma_horizontal_m = sigma_m;
    s.gnss.sigma_up_m = 2.0 * sigma_m;
    s.faults.pop_back();  // its own return
    if (reacquire != nullptr) s.faults.push_back(parse_fault(reacquire));
    NavigationConfig config = filter_config(s);
    config.aiding.lasting_errors = expects;
    Navigation filter(config);
    score.run(filter, simulate(s, seed), 151.0, 171.0);
  }
  return {score.share(), std::sqrt(score.squares / score.scored), std::sqrt(score.variances / score.scored)};
}

}  // namespace

TEST_CASE("fixes that come back displaced after a tunnel are not taken at their word") {
  struct Case {
    const char* fault;
    double honest;  // least share
  };
  for (const Case& c : {Case{"gnss.reacquire@150+22:error_m=4,decay_s=3", 0.99},
                        Case{"gnss.reacquire@150+22:error_m=4,decay_s=10", 0.98},
                        Case{"gnss.reacquire@150+22:error_m=15,decay_s=3", 0.99},
                        Case{"gnss.reacquire@150+22:error_m=2,decay_s=5", 0.93}}) {
    const Return expecting = return_from_tunnel(c.fault, FixType::kDifferential, 0.3, true);
    const Return trusting = return_from_tunnel(c.fault, FixType::kDifferential, 0.3, false);
    CAPTURE(c.fault, expecting.honest, expecting.error, trusting.honest, trusting.error);
    std::printf("%s: within three sigma %.3f, error %.3f m, claimed %.3f m; trusting: %.3f, %.3f m, %.3f m\n", c.fault,
                expecting.honest, expecting.error, expecting.sigma, trusting.honest, trusting.error, trusting.sigma);
    CHECK(expecting.honest > c.honest);
    CHECK(trusting.honest < 0.98);  // teeth
    CHECK(expecting.error < 0.5 * trusting.error);
  }
}

namespace {

/// Fixes with a fixed phase come back from half a minute without any, and the first five are 15 m off, `azimuth` clockwise
/// from north; no wheels. Level errors of some drives from the third of them on, when they are held against the receiver.
LevelScore back_displaced(double azimuth, const char* second = nullptr, bool step_detection = true) {
  LevelScore score;
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    ScenarioConfig s = scenario("highway");
    s.duration_s = 120.0;
    s.gnss.rate_hz = 1.0;
    char bias[96];
    (void)std::snprintf(bias, sizeof bias, "gnss.bias@90+4.9:east_m=%g,north_m=%g", 15.0 * std::sin(azimuth),
                        15.0 * std::cos(azimuth));
    for (const char* fault : {"wheels.silence@0+120", "gnss.silence@60+30", static_cast<const char*>(bias), second})
      if (fault != nullptr) s.faults.push_back(parse_fault(fault));
    NavigationConfig config = filter_config(s);
    config.aiding.step_detection = step_detection;
    Navigation filter(config);
    score.run(filter, simulate(s, seed), 93.0, 115.0);
  }
  return score;
}

}  // namespace

TEST_CASE("displaced fixes after an outage tell nothing of the filter's own error, whatever their direction") {
  // Of what they are off by, the direction was taken for the receiver's alone: squares were 4 to 120 times their variances, and
  // steps of biases and of the receiver's clock were found that never were.
  for (int k = 0; k < 4; ++k) {
    const LevelScore w = back_displaced(k * M_PI / 4.0);
    CAPTURE(k, w.share(), w.squares / w.variances);
    CHECK(w.share() > 0.98);
    CHECK(w.squares < 1.5 * w.variances);
  }
  // A clock that is set when that is over is found still. Teeth: not without the step detector.
  constexpr const char* kClock = "gnss.clock@95.5";
  const LevelScore found = back_displaced(0.0, kClock);
  CAPTURE(found.share(), found.squares / found.variances);
  CHECK(found.share() > 0.98);
  CHECK(found.squares < 1.5 * found.variances);
  const LevelScore missed = back_displaced(0.0, kClock, false);
  CAPTURE(missed.squares / missed.variances);
  CHECK(missed.squares > 5.0 * missed.variances);
}

TEST_CASE("what good fixes lose after a tunnel by expecting worse is bounded") {
  const auto compare = [](FixType type, double sigma, double most) {
    const Return expecting = return_from_tunnel(nullptr, type, sigma, true);
    const Return trusting = return_from_tunnel(nullptr, type, sigma, false);
    std::printf("good fixes of %.2f m after a tunnel: error %.4f m, claimed %.4f m; trusting: %.4f m, %.4f m\n", sigma,
                expecting.error, expecting.sigma, trusting.error, trusting.sigma);
    CHECK(expecting.honest > 0.99);
    CHECK(expecting.error < most * trusting.error);
    CHECK(expecting.sigma < most * trusting.sigma);
  };
  compare(FixType::kRtkFixed, 0.02, 1.1);
  compare(FixType::kDifferential, 0.3, 3.5);
}

namespace {

/// Over some drives through the bridge and the tunnel, the IMU is silent for three seconds from `hole_s` on; scored
/// from `from_s` to `to_s`.
LevelScore after_hole(double hole_s, double from_s, double to_s, bool expects) {
  LevelScore score;
  for (uint64_t seed = 1; seed <= 8; ++seed) {
    ScenarioConfig s = scenario("tunnel_dark");
    s.duration_s = to_s + 1.0;
    char fault[64];
    (void)std::snprintf(fault, sizeof fault, "imu.silence@%g+3", hole_s);
    s.faults.push_back(parse_fault(fault));
    NavigationConfig config = filter_config(s);
    config.aiding.lasting_errors = expects;
    Navigation filter(config);
    score.run(filter, simulate(s, seed), from_s, to_s);
    if (expects) CHECK(filter.output().reset_counter == 1);
  }
  return score;
}

}  // namespace

TEST_CASE("a start from the first fixes after a tunnel takes them for displaced") {
  const LevelScore held = after_hole(100.0, 165.0, 195.0, true);
  const LevelScore trusting = after_hole(100.0, 165.0, 195.0, false);
  std::printf("aligned again after a tunnel: square over variance %.2f, rms %.3f m; trusting %.1f, %.3f m\n",
              held.squares / held.variances, std::sqrt(held.squares / held.scored),
              trusting.squares / trusting.variances, std::sqrt(trusting.squares / trusting.scored));
  CHECK(held.squares < 1.5 * held.variances);
  CHECK(std::sqrt(held.squares / held.scored) < 0.3);
  CHECK(trusting.squares > 5.0 * trusting.variances);  // teeth
}

TEST_CASE("a start among fixes that have shown to claim too much does not take their claim") {
  const LevelScore held = after_hole(85.0, 90.0, 100.0, true), trusting = after_hole(85.0, 90.0, 100.0, false);
  std::printf("aligned again under a bridge: square over variance %.2f; trusting %.2f\n", held.squares / held.variances,
              trusting.squares / trusting.variances);
  CHECK(held.squares < 3.0 * held.variances);
  CHECK(trusting.squares > 3.0 * trusting.variances);  // teeth
}
