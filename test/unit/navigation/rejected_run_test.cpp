#include <catch2/catch.hpp>

#include "navigation/aiding/gnss_position/rejected_run.h"

using namespace roadfix::navigation;

namespace {

using Next = RejectedRun::Next;
constexpr int64_t kSecond = 1'000'000;

}  // namespace

TEST_CASE("of the rejected fixes of a run the newest that agree are counted", "[navigation][rejected_run]") {
  RejectedRun run;
  REQUIRE(run.empty());
  CHECK(run.add(1 * kSecond, {10.0, 0.0, 0.0}, 0.5) == Next::kFirst);
  CHECK(run.add(2 * kSecond, {10.0, 2.0, 0.0}, 0.5) == Next::kAgrees);  // a fifth of their size and the noise
  CHECK(run.agreeing() == 2);
  CHECK(run.add(3 * kSecond, {13.0, 0.0, 0.0}, 0.5) == Next::kAgrees);
  CHECK(run.add(4 * kSecond, {-10.0, 0.0, 0.0}, 0.5) == Next::kDiffers);
  CHECK(run.agreeing() == 1);
  CHECK(run.add(5 * kSecond, {-10.0, 0.0, 80.0}, 0.5) == Next::kAgrees);  // heights are not compared
  CHECK(run.newest_off().z() == 80.0);
  CHECK(run.since_us() == 1 * kSecond);  // of the run, whatever agrees
}

TEST_CASE("three rejected fixes before one that is used are a run that was lately", "[navigation][rejected_run]") {
  for (const bool over : {true, false})
    for (const int fixes : {2, 3}) {
      RejectedRun run;
      for (int k = 0; k < fixes; ++k) run.add(k * kSecond, {10.0, 0.0, 0.0}, 0.5);
      CHECK(!run.over_within(4 * kSecond, 3.0));
      run.end(4 * kSecond, over);
      CHECK(run.empty());
      CHECK(run.agreeing() == 0);
      CHECK(run.over_within(6 * kSecond, 3.0) == (over && fixes == 3));
      CHECK(!run.over_within(7 * kSecond, 3.0));
      CHECK(run.add(8 * kSecond, {10.0, 0.0, 0.0}, 0.5) == Next::kFirst);
    }
}
