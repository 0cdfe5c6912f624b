// What of a receiver's errors lasts, and for how long, from fixes against the way driven: white ones, lasting ones, and
// both at once.
#include <catch2/catch.hpp>
#include <random>

#include "navigation/aiding/gnss_position/lasting_error.h"

using namespace roadfix::navigation;

namespace {

const LastingErrorModels kAnyReceiver({5.0, 15.0, 50.0}, 0.9);

struct Receiver {
  double sigma = 2.0, share = 0.0, time = 15.0;  // m, of the whole error; share of its variance that lasts; s
  double claim = 2.0;                            // m
  double interval = 1.0;                         // s
  double drift = 0.02;                           // m/sqrt(s), of the way, as claimed
};

LastingErrorModels seen(const Receiver& r, double duration, unsigned seed, LastingErrorModels models = kAnyReceiver) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> n;
  const double decay = std::exp(-r.interval / r.time), lasting = std::sqrt(r.share) * r.sigma;
  const double white = std::sqrt(1.0 - r.share) * r.sigma;
  const auto pair = [&] {
    const double a = n(rng), b = n(rng);
    return Eigen::Vector2d(a, b);
  };
  Eigen::Vector2d b = lasting * pair(), way = Eigen::Vector2d::Zero();
  for (double t = 0.0; t < duration; t += r.interval) {
    b = decay * b + std::sqrt(1.0 - decay * decay) * lasting * pair();
    way += r.drift * std::sqrt(r.interval) * pair();
    const Eigen::Vector2d off = b + white * pair() - way;
    // The filter follows each fix a little, which the models take out again.
    models.add({static_cast<int64_t>(1e6 * t) + 1, off, 0.9 * off, Eigen::Vector2d::Constant(r.claim * r.claim),
                Eigen::Vector2d::Constant(r.drift * r.drift)});
    way += 0.1 * off;
  }
  return models;
}

/// Mean over some receivers.
LastingError mean(const Receiver& r, double duration) {
  constexpr int kReceivers = 11;
  LastingError sum{0.0, 0.0};
  for (unsigned seed = 1; seed <= kReceivers; ++seed) {
    const LastingError e = seen(r, duration, seed).mean();
    sum.share += e.share / kReceivers;
    sum.rate += e.rate / kReceivers;
  }
  return sum;
}

}  // namespace

TEST_CASE("before fixes have shown anything errors are taken for nearly white") {
  const LastingError prior = kAnyReceiver.mean();
  CHECK(prior.share > 0.0);
  CHECK(prior.share < 0.1);
}

TEST_CASE("white errors are found to be white, however large they claim to be") {
  for (const double claim : {0.5, 2.0, 8.0}) {
    const LastingError e = mean({2.0, 0.0, 15.0, claim}, 120.0);
    CAPTURE(claim, e.share);
    CHECK(e.share < 0.05);
  }
}

TEST_CASE("errors that last are found to last, and for how long") {
  for (const double claim : {1.0, 2.0, 4.0}) {
    const LastingError quick = mean({2.0, 0.8, 5.0, claim}, 180.0), slow = mean({2.0, 0.8, 40.0, claim}, 180.0);
    CAPTURE(claim, quick.share, quick.rate, slow.share, slow.rate);
    CHECK(quick.share > 0.6);
    CHECK(slow.share > 0.6);
    CHECK(quick.rate > 0.1);
    CHECK(slow.rate < 0.05);
  }
}

TEST_CASE("beside wheels alone errors are taken to last at first, and seconds are told from half a minute") {
  const LastingErrorModels street({3.0, 10.0, 30.0}, 0.1);
  CHECK(street.mean().share > 0.5);
  double quick = 0.0, slow = 0.0;
  for (unsigned seed = 1; seed <= 11; ++seed) {
    quick += seen({6.0, 0.8, 4.0, 6.0}, 180.0, seed, street).mean().rate / 11.0;
    slow += seen({6.0, 0.8, 30.0, 6.0}, 300.0, seed, street).mean().rate / 11.0;
  }
  CAPTURE(quick, slow);
  CHECK(quick > 0.1);
  CHECK(slow < 0.07);
}

TEST_CASE("how much larger errors are than they claim to be is found, whether they last or not") {
  CHECK(kAnyReceiver.variance_factor() == 1.0);
  for (const double share : {0.0, 0.5, 0.8}) {
    double factor = 0.0, honest = 0.0;
    for (unsigned seed = 1; seed <= 11; ++seed) {
      factor += seen({4.0, share, 5.0, 2.0}, 180.0, seed).variance_factor() / 11.0;
      honest += seen({4.0, share, 5.0, 4.0}, 180.0, seed).variance_factor() / 11.0;
    }
    CAPTURE(share, factor, honest);
    CHECK(factor > 2.8);
    CHECK(factor < 5.2);
    CHECK(honest < 1.4);  // teeth: the first would not pass
  }
}

TEST_CASE("a way that drifts as much as the errors do shows nothing of them") {
  Receiver lost{2.0, 0.8, 5.0};
  lost.drift = 10.0;
  CHECK(mean(lost, 120.0).share < 0.3);
}

TEST_CASE("fixes that follow each other fast show the same") {
  Receiver fast{2.0, 0.8, 5.0};
  fast.interval = 0.2;
  const LastingError e = mean(fast, 120.0);
  CHECK(e.share > 0.6);
  CHECK(e.rate > 0.07);
}
