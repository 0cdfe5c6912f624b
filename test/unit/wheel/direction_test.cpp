#include "wheel/direction.h"

#include <catch2/catch.hpp>
#include <cmath>

namespace roadfix {
namespace {

constexpr DirectionLimits kLimits{6.0, 3.0};

/// After one magnitude.
int sign_after(double magnitude, double predicted, double variance) {
  DirectionState d;
  add_magnitude(d, kLimits, 0, magnitude, predicted, variance);
  return d.sign;
}

TEST_CASE("the sign of a magnitude is decided by the likelihoods of both") {
  for (const double magnitude : {0.4, 3.0}) {
    for (const double variance : {0.1, 2.0}) {
      const auto likelihood = [&](double speed, double predicted) {
        return -0.5 * std::pow(speed - predicted, 2) / variance;
      };
      const double predicted = kLimits.evidence * variance / (2.0 * magnitude);
      CHECK(likelihood(magnitude, predicted) - likelihood(-magnitude, predicted) == Approx(kLimits.evidence));
      CHECK(sign_after(magnitude, 1.01 * predicted, variance) == 1);
      CHECK(sign_after(magnitude, 0.99 * predicted, variance) == 0);
      CHECK(sign_after(magnitude, -1.01 * predicted, variance) == -1);
    }
  }
}

TEST_CASE("a car that nothing tells the direction of is taken to go forward, and it is said") {
  DirectionState d;
  for (const double t_s : {0.0, 2.9}) add_magnitude(d, kLimits, std::llround(1e6 * t_s), 5.0, 0.0, 1.0);
  CHECK(d.sign == 0);
  add_magnitude(d, kLimits, 3'100'000, 5.0, 0.0, 1.0);
  CHECK(d.sign == 1);
  CHECK(d.assumed);
}

TEST_CASE("only a slow car changes its sign") {
  for (const double magnitude : {0.9 * kReversible, 1.1 * kReversible}) {
    DirectionState d{1, true, {}};
    add_magnitude(d, kLimits, 0, magnitude, -10.0, 0.1);
    CHECK(d.sign == (magnitude < kReversible ? -1 : 1));
    CHECK(d.assumed == (magnitude >= kReversible));
  }
}

}  // namespace
}  // namespace roadfix
