#include "wheel/direction.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "vehicle/axle_speed.h"

namespace roadfix {
namespace {

constexpr DirectionLimits kLimits{6.0, 3.0};

/// State after one magnitude.
int sign_after(double magnitude, double predicted, double variance) {
  DirectionState d;
  update_direction(d, kLimits, 0, magnitude, predicted, variance);
  return d.sign;
}

TEST_CASE("the sign of a speed magnitude follows the likelihood ratio") {
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

TEST_CASE("without evidence forward is assumed and reported") {
  DirectionState d;
  for (const double t_s : {0.0, 2.9}) update_direction(d, kLimits, std::llround(1e6 * t_s), 5.0, 0.0, 1.0);
  CHECK(d.sign == 0);
  update_direction(d, kLimits, 3'100'000, 5.0, 0.0, 1.0);
  CHECK(d.sign == 1);
  CHECK(d.assumed);
}

TEST_CASE("the sign changes only at low speed") {
  for (const double magnitude : {0.9 * vehicle::kSignKnown, 1.1 * vehicle::kSignKnown}) {
    DirectionState d{1, true, {}};
    update_direction(d, kLimits, 0, magnitude, -10.0, 0.1);
    CHECK(d.sign == (magnitude < vehicle::kSignKnown ? -1 : 1));
    CHECK(d.assumed == (magnitude >= vehicle::kSignKnown));
  }
}

}  // namespace
}  // namespace roadfix
