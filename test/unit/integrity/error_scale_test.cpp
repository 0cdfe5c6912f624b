#include "integrity/error_scale.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "simulation/random.h"
#include "statistics/chi_square.h"

using namespace roadfix;

namespace {

constexpr int64_t kSecond = 1'000'000;

ErrorScale seen(int count, double square, const ErrorScaleConfig& config = {}) {
  ErrorScale scale(config);
  for (int i = 1; i <= count; ++i) scale.add(i * 3 * kSecond, 3.0 * square, 3.0);
  return scale;
}

/// A sum of `dof` squared normal numbers.
double chi_square(RandomStream& random, int dof) {
  double sum = 0.0;
  for (int i = 0; i < dof; ++i) {
    const double x = random.normal();
    sum += x * x;
  }
  return sum;
}

struct Shares {
  double posterior = 0.0;
  double gaussian = 0.0;
};

/// Cars whose errors have a scale each, from the prior; ten squares of each are seen before its error is.
Shares shares_above(double risk) {
  constexpr int kCars = 40'000;
  const ErrorScaleConfig config{.prior_dof = 6.0, .memory = 1e6, .correlation = 0.0};
  RandomStream random(1, 1);
  const double gaussian = normal_quantile(1.0 - 0.5 * risk);
  Shares above;
  for (int car = 0; car < kCars; ++car) {
    const double scale = std::sqrt(6.0 / chi_square(random, 6));
    ErrorScale known(config);
    for (int i = 1; i <= 10; ++i) known.add(i, scale * scale * chi_square(random, 1), 1.0);
    const double error = std::abs(scale * random.normal());
    above.posterior += error > known.quantile(10, risk, 0.0) ? 1.0 / kCars : 0.0;
    above.gaussian += error > gaussian * known.scale(10) ? 1.0 / kCars : 0.0;
  }
  return above;
}

}  // namespace

TEST_CASE("error scale: errors of a scale known from a few squares are above the bound as often as the risk says") {
  const Shares above = shares_above(0.01);
  CHECK(above.posterior == Approx(0.01).margin(0.0017));  // 3.3 sigma of the count
  CHECK(above.gaussian > 0.015);                          // the same scale, tails taken for Gaussian
}

TEST_CASE("error scale: less seen is never a smaller bound") {
  for (const double risk : {1e-3, 1e-5}) {
    double last = INFINITY;
    for (const int count : {0, 1, 3, 10, 30}) {
      const double bound = seen(count, 1.0).quantile(count * 3 * kSecond, risk);
      CHECK(bound < last);
      CHECK(bound > normal_quantile(1.0 - 0.5 * risk));
      last = bound;
    }
    const ErrorScale scale = seen(10, 1.0);
    CHECK(scale.quantile(60 * kSecond, risk) > scale.quantile(40 * kSecond, risk));  // and forgets
  }
  CHECK(seen(10, 1.0).quantile(30 * kSecond, 1e-5) > seen(10, 1.0).quantile(30 * kSecond, 1e-3));
}

TEST_CASE("error scale: larger errors than claimed widen it, smaller ones do not narrow it below the claim") {
  CHECK(seen(30, 9.0).scale(90 * kSecond) > 2.3);
  CHECK(seen(30, 0.1).scale(90 * kSecond) < 0.7);
  CHECK(seen(30, 0.1).quantile(90 * kSecond, 1e-3) == seen(30, 1.0).quantile(90 * kSecond, 1e-3));
}

TEST_CASE("error scale: squares close in time count as one, a spike counts once, nonsense not at all") {
  ErrorScale dense({});
  for (int i = 0; i < 30; ++i) dense.add(3 * kSecond + i * 100'000, 3.0, 3.0);
  CHECK(dense.dof(6 * kSecond) < 6.0 + 3.0 * 2.1);
  ErrorScale spike({});
  spike.add(kSecond, 1e9, 3.0);
  CHECK(spike.scale(kSecond) < 4.0);
  const double before = spike.scale(kSecond);
  spike.add(2 * kSecond, std::nan(""), 3.0);
  spike.add(2 * kSecond, -1.0, 3.0);
  CHECK(spike.scale(kSecond) == before);
}
