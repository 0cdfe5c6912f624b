#include "evaluation/paired.h"

#include <catch2/catch.hpp>
#include <random>

using namespace roadfix;

namespace {

struct Costs {
  std::vector<double> a, b;
};

/// 50 drives of very different errors; b is a times `factor`, both with noise of 5 % of their own.
Costs noisy(unsigned seed, double factor) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  Costs costs;
  for (int i = 0; i < 50; ++i) {
    const double drive = std::exp(2.0 * normal(random));
    costs.a.push_back(drive * std::exp(0.05 * normal(random)));
    costs.b.push_back(drive * factor * std::exp(0.05 * normal(random)));
  }
  return costs;
}

/// How many of 200 tests have an interval without zero.
int found(double factor) {
  int count = 0;
  for (unsigned seed = 1; seed <= 200; ++seed) {
    const Costs costs = noisy(seed, factor);
    const PairedTest test = paired_test(costs.a, costs.b, 1e-6, 0.95);
    count += test.low > 0.0 || test.high < 0.0 ? 1 : 0;
  }
  return count;
}

}  // namespace

TEST_CASE(
    "paired: the interval misses no change in one of twenty tests, and finds 5 % under errors of a factor of 1000") {
  CHECK(found(1.0) >= 2);  // 10 +- 3 of 200
  CHECK(found(1.0) <= 20);
  CHECK(found(1.05) >= 190);
}

TEST_CASE("paired: the mean change lies in its interval, and p tells on which side of it zero is") {
  const Costs costs = noisy(3, 1.2);
  const PairedTest test = paired_test(costs.a, costs.b, 0.0, 0.99);
  CHECK(test.mean_change == Approx(0.2).margin(0.03));
  CHECK(test.low < test.mean_change);
  CHECK(test.mean_change < test.high);
  CHECK(test.p < 0.01);
  CHECK(test.worse + test.better == 50);
}

TEST_CASE("paired: nothing changed is nothing, exactly") {
  const std::vector<double> same = {0.1, 2.0, 0.0, 7.0};
  const PairedTest test = paired_test(same, same, 0.01);
  CHECK(test.mean_change == 0.0);
  CHECK(test.low == 0.0);
  CHECK(test.high == 0.0);
  CHECK(test.p == 1.0);
  CHECK(regressions(same, same, 0.01, 0.0).empty());
}

TEST_CASE("paired: one drive of 200 that gets worse is found, though the mean says nothing") {
  Costs costs;
  for (int i = 0; i < 200; ++i) costs.a.push_back(0.1 + 0.001 * i);
  costs.b = costs.a;
  costs.b[137] *= 1.3;
  CHECK(regressions(costs.a, costs.b, 0.01, 0.05) == std::vector<std::size_t>{137});
  CHECK(regressions(costs.a, costs.b, 0.01, 0.5).empty());
  CHECK(paired_test(costs.a, costs.b, 0.01).low <= 0.0);
}

TEST_CASE("paired: changes far below the floor are none, and the worst comes first") {
  CHECK(relative_change(1e-6, 1e-4, 0.01) < 0.01);
  CHECK(relative_change(0.0, 0.0, 0.01) == 0.0);
  CHECK(regressions({1.0, 1.0, 1.0}, {1.2, 2.0, 0.5}, 0.0, 0.1) == std::vector<std::size_t>{1, 0});
}

TEST_CASE("paired: one drive has no interval") {
  const PairedTest test = paired_test({1.0}, {2.0}, 0.0);
  CHECK(test.mean_change == Approx(1.0));
  CHECK(test.low == -1.0);
  CHECK(test.p == 1.0);
}
