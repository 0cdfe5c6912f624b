// How long a receiver's errors last, from fixes against the way gone: white ones, lasting ones, and in between.
#include <catch2/catch.hpp>
#include <random>

#include "navigation/aiding/gnss_position/error_time.h"

using namespace roadfix::navigation;

namespace {

/// After `duration` s of errors of `sigma` m that last `tau` s, with a fifth of their variance white, claimed as `claim`; `way`: m/s
/// by which the way may be off.
double found(double tau, double sigma, double claim, double interval, double duration, unsigned seed,
             double way = 0.0) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> n;
  ErrorTime time;
  const double decay = std::exp(-interval / tau), share = std::sqrt(0.8);
  Eigen::Vector2d b(share * sigma * n(rng), share * sigma * n(rng));
  for (double t = 0.0; t < duration; t += interval) {
    const Eigen::Vector2d drive(n(rng), n(rng)), white(n(rng), n(rng));
    b = decay * b + std::sqrt(1.0 - decay * decay) * share * sigma * drive;
    time.add(static_cast<int64_t>(1e6 * t) + 1, Eigen::Vector2d(100.0, -50.0) + b + std::sqrt(0.2) * sigma * white,
             Eigen::Vector2d::Constant(claim), way * t);
  }
  return time.time();
}

double median(double tau, double sigma, double claim, double interval, double duration) {
  std::vector<double> all;
  for (unsigned seed = 1; seed <= 11; ++seed) all.push_back(found(tau, sigma, claim, interval, duration, seed));
  std::nth_element(all.begin(), all.begin() + 5, all.end());
  return all[5];
}

}  // namespace

TEST_CASE("before fixes have shown anything errors last as long as elsewhere") {
  CHECK(ErrorTime().time() == ErrorTime::kPrior);
}

TEST_CASE("errors that last seconds are told from errors that last half a minute") {
  for (const double claim : {3.0, 4.5, 6.0, 12.0}) {
    const double quick = median(4.0, 6.0, claim, 0.2, 180.0), slow = median(30.0, 6.0, claim, 0.2, 300.0);
    CAPTURE(claim, quick, slow);
    CHECK(quick < slow);
    if (claim < 4.0 || claim > 7.0) continue;  // a claim far off is clipped, or taken for half of what lasts
    CHECK(quick <= 10.0);
    CHECK(quick >= 2.0);
    CHECK(slow >= 14.0);
  }
}

TEST_CASE("a way that nobody knows teaches nothing") {
  CHECK(found(3.0, 6.0, 6.0, 0.2, 200.0, 1) < 10.0);
  CHECK(found(3.0, 6.0, 6.0, 0.2, 200.0, 1, 20.0) == ErrorTime::kPrior);
}

TEST_CASE("fixes once a second or more often show the same") {
  const double often = median(4.0, 6.0, 6.0, 0.1, 300.0), seldom = median(4.0, 6.0, 6.0, 1.0, 300.0);
  CHECK(often <= 10.0);
  CHECK(seldom <= 10.0);
}
