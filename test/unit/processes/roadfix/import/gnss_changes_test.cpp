// Withheld and moved fixes: exactly those that were asked for.
#include "roadfix/import/gnss_changes.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "geodesy/enu_anchor.h"
#include "geometry/frames.h"

namespace roadfix {
namespace {

constexpr int64_t kStart = 1700000000000000;

/// `count` fixes at one place, `rate_hz` a second.
std::vector<GnssFix> fixes(int count, int rate_hz) {
  std::vector<GnssFix> list;
  for (int i = 0; i < count; ++i) {
    GnssFix fix;
    fix.t_us = kStart + static_cast<int64_t>(i) * 1000000 / rate_hz;
    fix.antenna = {48.0 * kDegree, 11.0 * kDegree, 500.0};
    list.push_back(fix);
  }
  return list;
}

double seconds(int64_t utime) { return seconds_between(kStart, utime); }

/// East, north, up of `fix` from where it was.
Eigen::Vector3d shift(const GnssFix& fix) {
  return EnuAnchor({48.0 * kDegree, 11.0 * kDegree, 500.0}).enu(fix.antenna);
}

TEST_CASE("without changes every fix is kept as it is") {
  const auto changed = change_gnss(fixes(100, 1), {});
  CHECK(changed.fixes.size() == 100);
  CHECK(changed.withheld_utimes.empty());
  CHECK(changed.outages.empty());
  CHECK(change_gnss({}, {}).fixes.empty());
}

TEST_CASE("windows withhold the fixes from their start up to before their end") {
  GnssChanges changes;
  changes.cut = CutGnss{10.0, 30.0, 20.0, 5.0};
  const auto changed = change_gnss(fixes(100, 1), changes);  // last fix at 99 s
  REQUIRE(changed.outages.size() == 2);  // starts at 25 and 55; 85 would end at 95, within 5 s of 99
  CHECK(seconds(changed.outages[0].first_withheld_us) == 25.0);
  CHECK(seconds(changed.outages[0].last_withheld_us) == 34.0);
  CHECK(seconds(changed.outages[0].return_us) == 35.0);
  CHECK(seconds(changed.outages[1].first_withheld_us) == 55.0);
  CHECK(changed.withheld_utimes.size() == 20);
  CHECK(changed.fixes.size() == 80);
  for (const GnssFix& fix : changed.fixes) {
    const double t = seconds(fix.t_us);
    CHECK_FALSE((t >= 25.0 && t < 35.0));
    CHECK_FALSE((t >= 55.0 && t < 65.0));
  }
}

TEST_CASE("a window that ends exactly 5 s before the last fix stays and one that ends later goes") {
  GnssChanges changes;
  changes.cut = CutGnss{10.0, 1000.0, 85.0, 0.0};
  CHECK(change_gnss(fixes(101, 1), changes).outages.size() == 1);  // ends at 95, last fix at 100
  CHECK(change_gnss(fixes(100, 1), changes).outages.empty());      // last fix at 99
}

TEST_CASE("windows that touch are outages of their own") {
  GnssChanges changes;
  changes.cut = CutGnss{10.0, 10.0, 20.0, 0.0};
  const auto changed = change_gnss(fixes(60, 1), changes);
  REQUIRE(changed.outages.size() == 3);
  CHECK(changed.outages[0].return_us == changed.outages[0].last_withheld_us);
  CHECK(seconds(changed.outages[2].return_us) == 50.0);
}

TEST_CASE("thinning keeps the first fix and every so-manyth after it") {
  GnssChanges changes;
  changes.keep_every = 4;
  const auto changed = change_gnss(fixes(10, 4), changes);
  REQUIRE(changed.fixes.size() == 3);
  CHECK(seconds(changed.fixes[1].t_us) == 1.0);
  CHECK(changed.withheld_utimes.size() == 7);
}

TEST_CASE("spikes move every so-manyth fix horizontally, each in a direction of its own") {
  GnssChanges changes;
  changes.spike = GnssSpike{20.0, 9};
  const auto changed = change_gnss(fixes(100, 1), changes);
  REQUIRE(changed.moved_utimes.size() == 11);
  CHECK(seconds(changed.moved_utimes[0]) == 8.0);
  double last_azimuth = 1e9;
  for (const GnssFix& fix : changed.fixes) {
    const bool is_spike = static_cast<int>(seconds(fix.t_us) + 1.0) % 9 == 0;
    const Eigen::Vector3d d = shift(fix);
    CHECK(d.norm() == Approx(is_spike ? 20.0 : 0.0).margin(1e-6));
    if (!is_spike) continue;
    CHECK(fix.antenna.height == 500.0);
    const double azimuth = std::atan2(d.x(), d.y());
    CHECK(std::abs(azimuth - last_azimuth) > 1e-3);
    last_azimuth = azimuth;
  }
}

TEST_CASE("the seed alone decides the directions") {
  GnssChanges changes;
  changes.spike = GnssSpike{20.0, 9};
  const auto once = change_gnss(fixes(100, 1), changes);
  const auto again = change_gnss(fixes(100, 1), changes);
  changes.azimuth_seed = 2;
  const auto other = change_gnss(fixes(100, 1), changes);
  CHECK(once.fixes[8].antenna.latitude == again.fixes[8].antenna.latitude);
  CHECK(once.fixes[8].antenna.latitude != other.fixes[8].antenna.latitude);
}

TEST_CASE("the first fixes after each outage are moved in one direction per outage") {
  GnssChanges changes;
  changes.cut = CutGnss{10.0, 30.0, 20.0, 0.0};
  changes.bias_after_outage = GnssBias{15.0, 5};
  const auto changed = change_gnss(fixes(100, 1), changes);
  REQUIRE(changed.outages.size() == 3);
  CHECK(changed.moved_utimes.size() == 15);
  std::vector<Eigen::Vector3d> directions;
  for (const GnssFix& fix : changed.fixes) {
    const double t = seconds(fix.t_us);
    const double since = std::fmod(t, 30.0);
    const bool biased = t >= 30.0 && since < 5.0 && t < 95.0;
    INFO(t);
    CHECK(shift(fix).norm() == Approx(biased ? 15.0 : 0.0).margin(1e-6));
    if (biased && since == 0.0) directions.push_back(shift(fix));
    if (biased) CHECK((shift(fix) - directions.back()).norm() < 1e-6);
  }
  CHECK((directions.at(0) - directions.at(1)).norm() > 0.1);
}

TEST_CASE("changes that make no sense are refused") {
  GnssChanges changes;
  changes.bias_after_outage = GnssBias{15.0, 5};
  CHECK_THROWS_WITH(change_gnss(fixes(10, 1), changes), "--gnss-bias-after-outage needs --cut-gnss");
  changes.cut = CutGnss{10.0, 5.0, 20.0, 0.0};
  CHECK_THROWS_WITH(change_gnss(fixes(10, 1), changes),
                    Catch::StartsWith("--every must not be shorter than --cut-gnss"));
}

TEST_CASE("changes that never end or go to infinity are refused") {
  constexpr double kInf = std::numeric_limits<double>::infinity();
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  for (const double wrong : {kInf, -kInf, kNan, 1e300}) {
    CAPTURE(wrong);
    for (const CutGnss& cut : {CutGnss{wrong, 30.0, 0.0, 0.0}, CutGnss{10.0, wrong, 0.0, 0.0},
                               CutGnss{10.0, 30.0, wrong, 0.0}, CutGnss{10.0, 30.0, 0.0, wrong}}) {
      GnssChanges changes;
      changes.cut = cut;
      CHECK_THROWS_AS(change_gnss(fixes(100, 1), changes), std::runtime_error);
    }
    GnssChanges changes;
    changes.spike = GnssSpike{wrong, 3};
    CHECK_THROWS_WITH(change_gnss(fixes(100, 1), changes), Catch::StartsWith("--gnss-spike must be within"));
    changes.spike.reset();
    changes.cut = CutGnss{10.0, 30.0, 0.0, 0.0};
    changes.bias_after_outage = GnssBias{wrong, 3};
    CHECK_THROWS_WITH(change_gnss(fixes(100, 1), changes),
                      Catch::StartsWith("--gnss-bias-after-outage must be within"));
  }
  GnssChanges changes;
  changes.cut = CutGnss{1e-12, 1e-12, 0.0, 0.0};  // a billion windows in a millisecond
  CHECK_THROWS_WITH(change_gnss(fixes(100, 1), changes), Catch::StartsWith("--cut-gnss must be within"));
}

}  // namespace
}  // namespace roadfix
