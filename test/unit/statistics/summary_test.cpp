#include "statistics/summary.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

namespace roadfix {
namespace {

TEST_CASE("summary of known values") {
  const Summary s = summarise({-3.0, 1.0, 2.0, 4.0});
  CHECK(s.count == 4);
  CHECK(s.mean == Approx(1.0));
  CHECK(s.rms == Approx(std::sqrt(7.5)));
  CHECK(s.median == Approx(2.5));
  CHECK(s.max == 4.0);
}

TEST_CASE("quantiles interpolate as numpy does") {
  // numpy.percentile([1, 2, 3, 4, 10], [25, 50, 95]) = 2, 3, 8.8
  const std::vector<double> values = {10.0, 3.0, 1.0, 4.0, 2.0};
  CHECK(quantile(values, 0.25) == Approx(2.0));
  CHECK(median(values) == Approx(3.0));
  CHECK(quantile(values, 0.95) == Approx(8.8));
  CHECK(quantile(values, 0.0) == 1.0);
  CHECK(quantile(values, 1.0) == 10.0);
}

TEST_CASE("nothing gives zeros, one value gives itself") {
  CHECK(summarise({}).count == 0);
  CHECK(summarise({}).rms == 0.0);
  CHECK(summarise({-2.0}).p95 == 2.0);
  CHECK(summarise({-2.0}).mean == -2.0);
}

TEST_CASE("mean norm and rms differ as they must") {
  const std::vector<double> values = {0.0, 0.0, 0.0, 4.0};
  CHECK(mean(values) == Approx(1.0));
  CHECK(root_mean_square(values) == Approx(2.0));
}

TEST_CASE("streaming quantile stays near the exact one") {
  std::mt19937_64 generator(5);
  std::exponential_distribution<double> exponential(1.0);
  StreamingQuantile p95(0.95);
  StreamingQuantile p50(0.5);
  for (int i = 0; i < 20000; ++i) {
    const double value = exponential(generator);
    p95.add(value);
    p50.add(value);
  }
  CHECK(p95.value() == Approx(-std::log(0.05)).epsilon(0.03));
  CHECK(p50.value() == Approx(std::log(2.0)).epsilon(0.03));
}

TEST_CASE("streaming quantile of fewer than five values is exact") {
  StreamingQuantile p50(0.5);
  p50.add(4.0);
  p50.add(1.0);
  p50.add(2.0);
  CHECK(p50.value() == 2.0);
}

}  // namespace
}  // namespace roadfix
