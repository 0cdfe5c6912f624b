#include "wheel/wheel_encoder.h"

#include <catch2/catch.hpp>
#include <climits>
#include <cmath>

#include "geometry/frames.h"

namespace roadfix {
namespace {

constexpr double kRadius = 0.3;
constexpr double kTicks = 512.0;

/// A wheel that rolls with `speed`, read every `dt_us` from a counter of `range` values.
EncoderReading rolling(int i, int64_t dt_us, double speed, int64_t first, int64_t range) {
  const double turns = speed * 1e-6 * static_cast<double>(dt_us * i) / (2.0 * kPi * kRadius);
  int64_t ticks = (first + std::llround(turns * kTicks)) % range;
  if (ticks < 0) ticks += range;
  return {1'700'000'000'000'000 + dt_us * i, 1, {ticks}};
}

TEST_CASE("a counter gives the mean speed, at the middle of the interval") {
  WheelEncoder encoder({kTicks, kRadius, 0});
  CHECK_FALSE(encoder.add({1'000'000, 2, {100, 50}}).has_value());
  const auto speeds = encoder.add({1'100'000, 2, {151, 40}});
  REQUIRE(speeds.has_value());
  CHECK(speeds->t_us == 1'050'000);
  CHECK(speeds->speed[0] == Approx(51.0 / 512.0 * 2.0 * kPi * 0.3 / 0.1));
  CHECK(speeds->speed[1] == Approx(-10.0 / 512.0 * 2.0 * kPi * 0.3 / 0.1));
}

TEST_CASE("a counter that wraps gives the same speeds as one that does not, forwards and backwards") {
  for (const int64_t range : {256, 1000, 65536}) {
    for (const double speed : {12.0, -12.0, 0.0}) {
      WheelEncoder wraps({kTicks, kRadius, static_cast<uint64_t>(range)});
      WheelEncoder plain({kTicks, kRadius, 0});
      for (int i = 0; i < 400; ++i) {
        const auto a = wraps.add(rolling(i, 10'000, speed, range / 2, range));
        const auto b = plain.add(rolling(i, 10'000, speed, INT64_C(1) << 40U, INT64_MAX));
        REQUIRE(a.has_value() == b.has_value());
        if (a) REQUIRE(a->speed[0] == b->speed[0]);
      }
    }
  }
}

TEST_CASE("a wrap that nobody told of is a jump: the comparison above can fail") {
  WheelEncoder encoder({kTicks, kRadius, 0});
  double largest = 0.0;
  for (int i = 0; i < 400; ++i) {
    const auto speeds = encoder.add(rolling(i, 10'000, 12.0, 500, 1000));
    if (speeds) largest = std::max(largest, std::abs(speeds->speed[0]));
  }
  CHECK(largest > 300.0);
}

TEST_CASE("differences go the shorter way round, at the ends of 64 bits too") {
  CHECK(tick_difference(65530, 4, 65536) == 10);
  CHECK(tick_difference(4, 65530, 65536) == -10);
  CHECK(tick_difference(-32760, 32766, 65536) == -10);  // a signed counter
  CHECK(tick_difference(990, 5, 1000) == 15);
  CHECK(tick_difference(INT64_MAX, INT64_MIN, 0) == 1);
  CHECK(tick_difference(INT64_MIN, INT64_MAX, 0) == -1);
  CHECK(tick_difference(INT64_MIN, INT64_MAX, 1000) == -1);
  CHECK(tick_difference(5, 3, 0) == -2);
}

TEST_CASE("no speed over a gap, of a time that is not later, of other wheels, and after a restart") {
  WheelEncoder encoder({kTicks, kRadius, 0});
  CHECK_FALSE(encoder.add({0, 1, {0}}).has_value());
  CHECK_FALSE(encoder.add({2'000'000, 1, {10}}).has_value());
  CHECK_FALSE(encoder.add({2'000'000, 1, {20}}).has_value());
  CHECK(encoder.add({2'010'000, 1, {20}}).has_value());
  CHECK_FALSE(encoder.add({2'020'000, 4, {20, 20, 20, 20}}).has_value());
  CHECK(encoder.add({2'030'000, 4, {20, 20, 20, 20}}).has_value());
  encoder.restart();
  CHECK_FALSE(encoder.add({2'040'000, 4, {20, 20, 20, 20}}).has_value());
}

}  // namespace
}  // namespace roadfix
