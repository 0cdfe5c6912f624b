// What a fix says about itself, and how long it takes a bad receiver to be believed again.
#include <catch2/catch.hpp>
#include <limits>

#include "navigation/aiding/gnss_screen.h"

using namespace roadfix;
using namespace roadfix::navigation;

namespace {

GnssFix good() {
  GnssFix f;
  f.t_us = 1'000'000;
  f.fix_type = FixType::kDifferential;
  f.antenna = {0.8, 0.2, 500.0};
  f.cov_enu = Eigen::Matrix3d::Identity();
  f.num_satellites = 9;
  f.pdop = 2.0;
  f.correction_age = 3.0;
  return f;
}

template <class Change>
AidingStatus first_seen(const Change& change) {
  GnssScreen screen((GnssScreenConfig()));
  GnssFix f = good();
  change(f);
  const AidingStatus status = screen.check(f);
  if (status != AidingStatus::kAccepted) CHECK(std::string(screen.reason()) != "");
  return status;
}

}  // namespace

TEST_CASE("a good fix is accepted and a poor one is refused with its reason") {
  CHECK(first_seen([](GnssFix&) {}) == AidingStatus::kAccepted);
  CHECK(first_seen([](GnssFix& f) { f.fix_type = FixType::kNone; }) == AidingStatus::kBadQuality);
  CHECK(first_seen([](GnssFix& f) { f.fix_type = FixType::kDeadReckoning; }) == AidingStatus::kBadQuality);
  CHECK(first_seen([](GnssFix& f) { f.num_satellites = 3; }) == AidingStatus::kBadQuality);
  CHECK(first_seen([](GnssFix& f) { f.pdop = 11.0; }) == AidingStatus::kBadQuality);
  CHECK(first_seen([](GnssFix& f) { f.correction_age = 61.0; }) == AidingStatus::kBadQuality);
  CHECK(first_seen([](GnssFix& f) { f.cov_enu *= 1e4; }) == AidingStatus::kBadQuality);
}

TEST_CASE("what a receiver without a fix sends is bad input") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK(first_seen([](GnssFix& f) { f.antenna.latitude = f.antenna.longitude = 0.0; }) == AidingStatus::kBadInput);
  CHECK(first_seen([&](GnssFix& f) { f.antenna.height = nan; }) == AidingStatus::kBadInput);
  CHECK(first_seen([](GnssFix& f) { f.antenna.latitude = 2.0; }) == AidingStatus::kBadInput);
  CHECK(first_seen([](GnssFix& f) { f.antenna.height = 40e3; }) == AidingStatus::kBadInput);
  CHECK(first_seen([](GnssFix& f) { f.cov_enu(1, 1) = -1.0; }) == AidingStatus::kBadInput);
  CHECK(first_seen([&](GnssFix& f) {
          f.velocity = GnssVelocity{{nan, 0.0, 0.0}, Eigen::Matrix3d::Zero()};
        }) == AidingStatus::kBadInput);
}

TEST_CASE("a receiver that was bad is believed after three good fixes, by the stricter limit") {
  const GnssScreenConfig config;
  GnssScreen screen(config);
  GnssFix edge = good();
  edge.pdop = 1.1 * config.max_pdop;
  CHECK(screen.check(good()) == AidingStatus::kAccepted);
  CHECK(screen.check(edge) == AidingStatus::kAccepted);  // believed: may be a little worse
  GnssFix none = good();
  none.fix_type = FixType::kNone;
  CHECK(screen.check(none) == AidingStatus::kBadQuality);
  CHECK(screen.quality() == GnssQuality::kBad);
  CHECK(screen.check(edge) == AidingStatus::kBadQuality);  // the same fix, not enough to be believed again
  CHECK(screen.check(good()) == AidingStatus::kBadQuality);
  CHECK(screen.quality() == GnssQuality::kProbation);
  CHECK(screen.check(good()) == AidingStatus::kBadQuality);
  CHECK(screen.check(good()) == AidingStatus::kAccepted);
  CHECK(screen.quality() == GnssQuality::kGood);
}

TEST_CASE("the receiver's interval is that of its fixes, and an outage is none") {
  GnssScreen screen((GnssScreenConfig()));
  GnssFix f = good();
  const auto after = [&](double s) {
    f.t_us += static_cast<int64_t>(1e6 * s);
    REQUIRE(screen.check(f) == AidingStatus::kAccepted);
    return screen.interval();
  };
  after(0.0);
  after(5.0);
  CHECK(after(5.0) == 5.0);
  CHECK(after(60.0) == 5.0);
  CHECK(after(5.0) == 5.0);
  after(1.0);
  CHECK(after(1.0) == 1.0);
}
