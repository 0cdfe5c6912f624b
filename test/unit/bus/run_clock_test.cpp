#include "bus/run/run_clock.h"

#include <catch2/catch.hpp>

using namespace roadfix;

TEST_CASE("a step of the wall clock reaches utime only as a slew of 100 ppm") {
  SlewedOffset offset(1'000'000, 5'000'000'000);
  int64_t utime = offset.utime(1'000'000, 5'000'000'000);
  REQUIRE(utime == 5'000'000'000);
  for (const int64_t step_us : {3'000'000, -3'000'000}) {
    SlewedOffset stepped(0, 1'000'000'000);
    int64_t last_t = 0;
    int64_t last = stepped.utime(0, 1'000'000'000);
    for (int64_t t = 7; t < 20'000'000; t += 707) {
      const int64_t now = stepped.utime(t, 1'000'000'000 + t + step_us);
      REQUIRE(now >= last);
      last = now;
      last_t = t;
    }
    const int64_t slewed = last - (1'000'000'000 + last_t);
    REQUIRE(std::abs(slewed) >= 1990);
    REQUIRE(std::abs(slewed) <= 2010);
    REQUIRE((slewed > 0) == (step_us > 0));
  }
}

TEST_CASE("a small error is slewed away and then stays away") {
  SlewedOffset offset(0, 1000);
  int64_t utime = 0;
  for (int64_t t = 0; t <= 10'000'000; t += 1000) utime = offset.utime(t, t + 1000 + 500);
  REQUIRE(utime == 10'000'000 + 1500);
  REQUIRE(offset.behind_us(10'000'000, 10'001'500) == 0);
}
