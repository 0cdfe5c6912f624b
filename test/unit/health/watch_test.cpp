// When the monitor decides, and what it counts.
#include <catch2/catch.hpp>

#include "small_car.h"

using namespace roadfix;

TEST_CASE("decisions lie on tenths of a second that are over, each once, however seldom the clock is looked at") {
  Health health(HealthConfig{}, Expectations{});
  std::optional<int64_t> last;
  for (double t = 0.037; t < 20.0; t += t < 10.0 ? 0.013 : 0.57) {
    while (const auto due = health.next_decision(test::at(t))) {
      CHECK(*due <= test::at(t));
      CHECK(*due % 100'000 == 0);
      CHECK(*due == last.value_or(*due - 100'000) + 100'000);
      last = *due;
      health.decide(*due);
    }
    if (last) CHECK(test::at(t) - *last < 100'000);
  }
  CHECK(last);
}

TEST_CASE("the rate of a channel is that of its messages, and nought once it is silent") {
  ChannelWatch watch("GNSS", ChannelLimits{}, 10.0);
  CHECK(watch.report(test::at(0.0), 0).rate_hz == 0.0);
  for (int i = 0; i < 50; ++i) watch.arrived({test::at(0.1 * i), test::at(0.1 * i), 1, i, 100, std::nullopt});
  CHECK(watch.report(test::at(4.95), 0).rate_hz == Approx(10.0).epsilon(0.02));
  CHECK(watch.report(test::at(9.0), 0).rate_hz == 0.0);
}
