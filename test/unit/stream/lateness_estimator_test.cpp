#include "stream/lateness_estimator.h"

#include <catch2/catch.hpp>

using namespace roadfix;

namespace {

constexpr int kVision = 1, kWheel = 2;  // inputs; 0 is the clock
constexpr int64_t kMs = 1000;

LatenessEstimator some_watch() {
  return LatenessEstimator({{"CLOCK", "pose_t", 0}, {"VISION", "pose_t", 200 * kMs}, {"WHEEL", "pose_t", 50 * kMs}});
}

/// Ten a second for `seconds`; all changes, in milliseconds.
std::vector<int64_t> listen(LatenessEstimator& watch, int64_t& clock_utime, double seconds, int64_t lateness_ms) {
  std::vector<int64_t> changes;
  for (const int64_t end = clock_utime + static_cast<int64_t>(seconds * 1e6); clock_utime < end;
       clock_utime += 100 * kMs) {
    watch.note(kVision, clock_utime, clock_utime - lateness_ms * kMs);
    watch.note(kWheel, clock_utime, clock_utime - 5 * kMs);
    if (const std::optional<int64_t> change = watch.change(clock_utime)) changes.push_back(*change / kMs);
  }
  return changes;
}

}  // namespace

TEST_CASE("punctual inputs get the minimum lateness") {
  LatenessEstimator watch = some_watch();
  int64_t now = 1'000'000'000;
  REQUIRE(watch.allowed_us() == 100 * kMs);
  REQUIRE(listen(watch, now, 60.0, 60).empty());
  REQUIRE(watch.allowed_us() == 100 * kMs);
}

TEST_CASE("a larger lateness takes effect at once and ends after twenty seconds without need") {
  LatenessEstimator watch = some_watch();
  int64_t now = 1'000'000'000;
  listen(watch, now, 5.0, 60);
  REQUIRE(listen(watch, now, 0.2, 103) == std::vector<int64_t>{160});  // half as much again, to the next 10 ms
  REQUIRE(listen(watch, now, 0.2, 190) == std::vector<int64_t>{200});  // no more than stated
  const int64_t then = now;
  while (watch.allowed_us() == 200 * kMs) {
    listen(watch, now, 0.1, 40);
    REQUIRE(now - then < 21'000 * kMs);
  }
  REQUIRE(now - then > 10'000 * kMs);
  REQUIRE(watch.allowed_us() == 100 * kMs);
}

TEST_CASE("a single late message is not waited for, nor one beyond the specification") {
  LatenessEstimator watch = some_watch();
  int64_t now = 1'000'000'000;
  listen(watch, now, 5.0, 60);
  watch.note(kVision, now, now - 180 * kMs);
  REQUIRE_FALSE(watch.change(now));
  REQUIRE(listen(watch, now, 1.0, 300).empty());
  watch.note(kVision, now, now - 180 * kMs);  // the second one within the window
  REQUIRE(watch.change(now) == 200 * kMs);
}

TEST_CASE("channels specified as punctual get no more than specified") {
  LatenessEstimator watch({{"CLOCK", "pose_t", 0}, {"WHEEL", "pose_t", 50 * kMs}});
  REQUIRE(watch.allowed_us() == 50 * kMs);
  for (int i = 0; i < 10; ++i) watch.note(1, 1'000'000, 1'000'000 - 50 * kMs);
  REQUIRE_FALSE(watch.change(1'000'000));
}
