#include <catch2/catch.hpp>

#include "health/alarms.h"

using namespace roadfix;

namespace {

constexpr int64_t kTenth = 100'000;
const Condition kLate{"late", Verdict::kDegraded, kRankSensor, "late"};
const Condition kDead{"dead", Verdict::kDoNotUse, kRankPose, "dead"};

}  // namespace

TEST_CASE("a condition of one look is not told, one of two is") {
  Alarms alarms({0.1, 0.7});
  CHECK_FALSE(alarms.update(9 * kTenth, {}));
  CHECK_FALSE(alarms.update(10 * kTenth, {kLate}));
  CHECK_FALSE(alarms.update(11 * kTenth, {}));
  CHECK_FALSE(alarms.update(12 * kTenth, {kLate}));
  CHECK(alarms.verdict() == Verdict::kOk);
  CHECK(alarms.update(13 * kTenth, {kLate}));
  CHECK(alarms.verdict() == Verdict::kDegraded);
  CHECK(alarms.since_us() == 13 * kTenth);
}

TEST_CASE("a flickering condition is told once and stays") {
  Alarms alarms({0.1, 0.7});
  int changes = 0;
  for (int i = 1; i <= 60; ++i) {
    const bool there = i % 5 < 2;
    changes += alarms.update(i * kTenth, there ? std::vector{kLate} : std::vector<Condition>{}) ? 1 : 0;
  }
  CHECK(changes == 1);
  CHECK(alarms.verdict() == Verdict::kDegraded);

  Alarms nervous({0.0, 0.0});
  changes = 0;
  for (int i = 1; i <= 60; ++i) {
    const bool there = i % 5 < 2;
    changes += nervous.update(i * kTenth, there ? std::vector{kLate} : std::vector<Condition>{}) ? 1 : 0;
  }
  CHECK(changes > 20);
}

TEST_CASE("what is wrong at the first look is told at once") {
  Alarms alarms({0.1, 0.7});
  CHECK(alarms.update(1 * kTenth, {kDead}));
  CHECK(alarms.verdict() == Verdict::kDoNotUse);
}

TEST_CASE("what is over is forgotten after its time") {
  Alarms alarms({0.1, 0.7});
  alarms.update(1 * kTenth, {kLate});
  alarms.update(2 * kTenth, {kLate});
  for (int i = 3; i <= 9; ++i) alarms.update(i * kTenth, {});
  CHECK(alarms.verdict() == Verdict::kDegraded);
  alarms.update(10 * kTenth, {});
  CHECK(alarms.verdict() == Verdict::kOk);
  CHECK(alarms.reasons().empty());
}

TEST_CASE("the worst reason decides and comes first, a condition that gets worse counts at once") {
  Alarms alarms({0.1, 0.7});
  alarms.update(1 * kTenth, {kLate, kDead});
  alarms.update(2 * kTenth, {kLate, kDead});
  REQUIRE(alarms.reasons().size() == 2);
  CHECK(alarms.reasons().front().key == "dead");
  CHECK(alarms.verdict() == Verdict::kDoNotUse);
  Condition severer = kLate;
  severer.verdict = Verdict::kDoNotUse;
  for (int i = 3; i <= 12; ++i) alarms.update(i * kTenth, {kLate});
  CHECK(alarms.verdict() == Verdict::kDegraded);
  CHECK(alarms.update(13 * kTenth, {severer}));
  CHECK(alarms.verdict() == Verdict::kDoNotUse);
}
