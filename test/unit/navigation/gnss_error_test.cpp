// Errors of a receiver that last, beside white ones, and white ones alone.
#include <catch2/catch.hpp>
#include <cstdio>

#include "filter_run.h"

using namespace roadfix;
using namespace roadfix::navtest;

namespace {

struct Drives {
  double ratio = 0.0, rms = 0.0, honest = 0.0;  ///< squares over variances; m; share within three sigmas
};

/// City loops with `white` and `wandering` errors (m), from the first minute on.
Drives drives(FixType type, double rate_hz, double white, double wandering, double time_s, bool expects) {
  LevelScore score;
  for (uint64_t seed = 1; seed <= 12; ++seed) {
    ScenarioConfig s = scenario("city_loop");
    s.duration_s = 200.0;
    s.gnss.fix_type = type;
    s.gnss.rate_hz = rate_hz;
    s.gnss.sigma_horizontal_m = white;
    s.gnss.sigma_up_m = 2.0 * white;
    s.gnss.multipath_sigma_m = wandering;
    s.gnss.multipath_correlation_s = time_s;
    NavigationConfig config = filter_config(s);
    config.aiding.lasting_errors = expects;
    Navigation filter(config);
    score.run(filter, simulate(s, seed), 60.0, 199.0);
  }
  return {score.squares / score.variances, std::sqrt(score.squares / score.scored), score.share()};
}

}  // namespace

TEST_CASE("errors of two kinds at once do not make a wrong place sure, and white ones cost little") {
  struct Case {
    FixType type;
    double rate_hz, white, wandering, time_s;
  };
  for (const Case& c :
       {Case{FixType::kDifferential, 5.0, 0.3, 0.6, 15.0}, Case{FixType::kSingle, 1.0, 1.5, 2.0, 30.0}}) {
    const Drives now = drives(c.type, c.rate_hz, c.white, c.wandering, c.time_s, true);
    const Drives trusting = drives(c.type, c.rate_hz, c.white, c.wandering, c.time_s, false);
    const Drives white = drives(c.type, c.rate_hz, c.white, 0.0, c.time_s, true);
    const Drives told = drives(c.type, c.rate_hz, c.white, 0.0, c.time_s, false);
    std::printf(
        "%.1f m white and %.1f m for %.0f s: squares over variances %.2f, rms %.2f m, within three sigma %.3f; "
        "trusting %.2f, %.2f m, %.3f; white alone %.2f, %.3f m, %.3f; trusting %.2f, %.3f m\n",
        c.white, c.wandering, c.time_s, now.ratio, now.rms, now.honest, trusting.ratio, trusting.rms, trusting.honest,
        white.ratio, white.rms, white.honest, told.ratio, told.rms);
    CHECK(now.ratio < 2.5);
    CHECK(now.honest > 0.9);
    CHECK(trusting.ratio > 4.0);  // teeth
    CHECK(trusting.honest < 0.8);
    CHECK(white.rms < 1.3 * told.rms);
    CHECK(white.ratio > 0.6 * told.ratio);
    CHECK(white.honest > 0.99);
  }
}
