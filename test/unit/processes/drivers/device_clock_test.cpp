#include "drivers/protocols/device_clock.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

namespace roadfix {
namespace {

constexpr int64_t kStart_us = 1'700'000'000'000'000;

/// 100 Hz for `seconds`; exponential delays of 1 ms over 0.4 ms of path; the device's clock runs `ppm` fast.
/// The worst error after the first ten seconds, s, against device time as the computer's clock would have stamped it.
double worst_error(double ppm, int seconds, bool filtered) {
  std::mt19937 random(3);
  DeviceClock clock;
  double worst = 0.0;
  for (int i = 0; i < 100 * seconds; ++i) {
    const int64_t true_us = kStart_us + int64_t{10'000} * i;
    const auto device_us = static_cast<int64_t>(5e6 + 1e4 * i * (1.0 + ppm * 1e-6));
    const double uniform = (static_cast<double>(random()) + 1.0) / 4294967297.0;
    const int64_t read_us = true_us + 400 + static_cast<int64_t>(-1000.0 * std::log(uniform));
    const auto utime = clock.utime(device_us, read_us);
    REQUIRE(utime);
    if (i > 1000) worst = std::max(worst, std::abs(static_cast<double>((filtered ? *utime : read_us) - true_us - 400)));
  }
  return worst * 1e-6;
}

TEST_CASE("stamps follow the device's even clock, not the jitter of reading") {
  for (const double ppm : {-100.0, 0.0, 100.0}) {
    CHECK(worst_error(ppm, 600, true) < 0.4e-3);
    CHECK(worst_error(ppm, 600, false) > 5e-3);  // teeth: the times of reading are that bad
  }
}

TEST_CASE("what was buffered before the start does not stay in the offset") {
  DeviceClock clock;
  // A second of old data comes at once, then it is live.
  for (int i = 0; i < 100; ++i) REQUIRE(clock.utime(10'000 * i, kStart_us));
  CHECK(*clock.utime(1'000'000, kStart_us + 500) == kStart_us + 500);
  CHECK(*clock.utime(1'010'000, kStart_us + 90'000) < kStart_us + 10'600);  // 80 ms late: the map holds
}

TEST_CASE("one stamp that jumped is refused, a clock that was set anew is followed") {
  DeviceClock clock;
  int64_t t = 0;
  for (; t < 1'000'000; t += 10'000) REQUIRE(clock.utime(t, kStart_us + t));
  CHECK_FALSE(clock.utime(t + 3'600'000'000, kStart_us + t));
  CHECK(clock.utime(t, kStart_us + t) == kStart_us + t);
  CHECK(clock.restarts() == 0);
  const int64_t off = 3'600'000'000;
  CHECK_FALSE(clock.utime(t + off, kStart_us + t));
  CHECK_FALSE(clock.utime(t + off + 10'000, kStart_us + t + 10'000));
  CHECK(clock.utime(t + off + 20'000, kStart_us + t + 20'000) == kStart_us + t + 20'000);
  CHECK(clock.restarts() == 1);
  // And backwards: the device was switched off and on.
  CHECK_FALSE(clock.utime(0, kStart_us + t + 30'000));
  CHECK_FALSE(clock.utime(10'000, kStart_us + t + 40'000));
  CHECK(clock.utime(20'000, kStart_us + t + 50'000) == kStart_us + t + 50'000);
  CHECK_FALSE(clock.utime(INT64_MAX, kStart_us));
  CHECK_FALSE(clock.utime(INT64_MIN, kStart_us));
}

/// 10 Hz for a minute, read 1 ms late; after 20 s the device's clock is `back_us` behind, for `for_s` seconds. The
/// error of the stamp at `at_s` seconds, us.
int64_t error_after_step(int64_t back_us, int for_s, int at_s) {
  DeviceClock clock;
  for (int i = 0; i < 600; ++i) {
    const int64_t t_us = int64_t{100'000} * i;
    const bool back = i >= 200 && i < 200 + 10 * for_s;
    const auto utime = clock.utime(t_us - (back ? back_us : 0), kStart_us + t_us + 1000);
    REQUIRE(utime);
    REQUIRE(*utime <= kStart_us + t_us + 1000);
    if (i == 10 * at_s) return *utime - (kStart_us + t_us + 1000);
  }
  return INT64_MAX;
}

TEST_CASE("a clock that was set back by a leap second is followed after ten seconds") {
  CHECK(error_after_step(1'000'000, 40, 29) < -990'000);  // it may still be a slow path
  CHECK(std::abs(error_after_step(1'000'000, 40, 31)) <= 1);
  CHECK(std::abs(error_after_step(700'000, 40, 31)) <= 1);
  CHECK(error_after_step(400'000, 40, 31) < -390'000);        // a path's delay that grew: no step
  CHECK(std::abs(error_after_step(1'000'000, 5, 40)) < 10);   // late for 5 s only: the offset stays
  CHECK(std::abs(error_after_step(1'000'000, 20, 55)) <= 1);  // set back, and forward again
}

TEST_CASE("a counter of 32 bits goes on over its wrap, and a new start is told from one") {
  WrappingClock clock;
  int64_t last = clock.unwrap(4'294'900'000U);
  for (int i = 1; i < 100; ++i) {
    const int64_t next = clock.unwrap(4'294'900'000U + 5000U * static_cast<uint32_t>(i));
    REQUIRE(next - last == 5000);
    last = next;
  }
  CHECK(clock.unwrap(static_cast<uint32_t>(last - 100'000)) == last - 100'000);  // a slower message of the same device
  // Twelve wraps of the clock's own 71.6 min: 14 h of drive.
  for (int i = 0; i < 12 * 4295; ++i) {
    const int64_t next = clock.unwrap(static_cast<uint32_t>(last + 1'000'000));
    REQUIRE(next == last + 1'000'000);
    last = next;
  }
  const int64_t again = clock.unwrap(static_cast<uint32_t>(last) - 100'000'000U);
  CHECK(again == last - 100'000'000);
  CHECK(clock.unwrap(static_cast<uint32_t>(again + 5000)) == again + 5000);
}

}  // namespace
}  // namespace roadfix
