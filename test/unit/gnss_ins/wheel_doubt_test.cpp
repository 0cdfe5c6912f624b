// Wheels against a receiver's velocity, both as they differ from a filter that is wrong itself.
#include <catch2/catch.hpp>

#include "gnss_ins/wheel_doubt.h"
#include "simulation/random.h"

using namespace roadfix;

namespace {

constexpr double kReceiver = 0.05, kWheel = 0.05, kSpeed = 12.0;  // m/s
constexpr double kSigmas = 5.0;

/// s until wheels that read too much by this share are doubted; nothing within the time.
std::optional<double> doubted_after(double share, double seconds, uint64_t seed, double contradiction = 0.0) {
  RandomStream random(seed, 1);
  WheelDoubt doubt;
  for (int k = 1; k <= static_cast<int>(5.0 * seconds); ++k) {
    const double filter = 0.3 * std::sin(0.1 * k);  // m/s, by which the filter is too fast
    for (int i = 0; i < 2; ++i) doubt.wheels(share * kSpeed - filter + kWheel * random.normal());
    const WheelDoubt::Speed s{k * int64_t{200'000},  kSpeed,          -filter + kReceiver * random.normal(),
                              kReceiver * kReceiver, kWheel * kWheel, 1e-8,
                              contradiction};
    if (const auto d = doubt.receiver(s, kSigmas)) {
      CHECK(d->share == Approx(-share).margin(0.005));
      CHECK(d->way <= kSpeed * 0.2 * k + 1e-6);
      return 0.2 * k;
    }
  }
  return std::nullopt;
}

}  // namespace

TEST_CASE("wheels and a receiver that tell one speed are not doubted, whatever the filter has") {
  for (uint64_t seed = 1; seed <= 10; ++seed) CHECK(!doubted_after(0.0, 1000.0, seed));
}

TEST_CASE("a large slip is doubted within two seconds, a small one within half a minute") {
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    CAPTURE(seed);
    CHECK(doubted_after(0.03, 1000.0, seed).value_or(1e9) <= 2.4);
    CHECK(doubted_after(0.004, 1000.0, seed).value_or(1e9) <= 30.0);
  }
}

TEST_CASE(
    "a receiver whose positions do not follow its velocities, or that stands still, does not make wheels doubted") {
  CHECK(doubted_after(0.03, 100.0, 1, 0.03));
  CHECK(!doubted_after(0.03, 100.0, 1, 0.2));
  CHECK(!doubted_after(0.03, 100.0, 1, -0.2));
  CHECK(!doubted_after(1.0, 100.0, 1));  // it stands still, and the car does not
}
