#include "stream/clock_selector.h"

#include <catch2/catch.hpp>

using namespace roadfix;
using Verdict = ClockSelector::Verdict;

namespace {
constexpr int kIns = 4;
constexpr int kVo = 7;
constexpr int kWheel = 2;
ClockSelector three_clocks() { return ClockSelector({{kIns, 100}, {kVo, 200}, {kWheel, 300}}); }
}  // namespace

TEST_CASE("the preferred clock ticks, the others are inputs, an older tick is refused") {
  ClockSelector clock = three_clocks();
  REQUIRE(clock.offer(kIns, 1000) == Verdict::kTick);
  REQUIRE(clock.changed());
  REQUIRE(clock.offer(kVo, 1050) == Verdict::kInput);
  REQUIRE(clock.offer(kWheel, 900) == Verdict::kInput);
  REQUIRE(clock.offer(99, 1050) == Verdict::kInput);
  REQUIRE(clock.offer(kIns, 1010) == Verdict::kTick);
  REQUIRE_FALSE(clock.changed());
  REQUIRE(clock.offer(kIns, 1010) == Verdict::kRefused);
  REQUIRE(clock.offer(kIns, 1005) == Verdict::kRefused);
  REQUIRE(clock.utime() == 1010);
}

TEST_CASE("after its time-out a clock is replaced by the next, and returns at once") {
  ClockSelector clock = three_clocks();
  clock.offer(kIns, 1000);
  clock.offer(kVo, 1050);
  REQUIRE(clock.offer(kVo, 1100) == Verdict::kInput);  // just at the time-out
  REQUIRE(clock.offer(kVo, 1101) == Verdict::kTick);
  REQUIRE(clock.changed());
  REQUIRE(clock.active_input() == kVo);
  REQUIRE(clock.offer(kWheel, 1200) == Verdict::kInput);  // the camera is alive
  REQUIRE(clock.offer(kIns, 1090) == Verdict::kRefused);  // preferred, but behind the clock
  REQUIRE(clock.offer(kVo, 1105) == Verdict::kInput);     // which rests now for it to get ahead
  REQUIRE(clock.offer(kIns, 1110) == Verdict::kTick);
  REQUIRE(clock.active_input() == kIns);
}

TEST_CASE("a clock suspended for one that did not return continues after the time-out, as a change") {
  ClockSelector clock = three_clocks();
  clock.offer(kIns, 1000);
  clock.offer(kVo, 1060);
  clock.offer(kVo, 1101);
  clock.offer(kIns, 1095);
  REQUIRE(clock.offer(kVo, 1150) == Verdict::kInput);
  REQUIRE(clock.offer(kVo, 1196) == Verdict::kTick);
  REQUIRE(clock.changed());
  REQUIRE(clock.offer(kVo, 1200) == Verdict::kTick);
  REQUIRE_FALSE(clock.changed());
}

TEST_CASE("a fallback with stamps ahead causes no time-out of an active clock") {
  ClockSelector clock = three_clocks();
  for (int64_t t = 1000; t < 3000; t += 10) {
    REQUIRE(clock.offer(kIns, t) == Verdict::kTick);
    if (t % 20 == 0) REQUIRE(clock.offer(kVo, t + (t < 1500 ? -30 : 400)) == Verdict::kInput);
  }
  for (int64_t t = 3400; t <= 3430; t += 10) REQUIRE(clock.offer(kVo, t) == Verdict::kInput);
  REQUIRE(clock.offer(kVo, 3440) == Verdict::kTick);  // once the other is silent: a third of its time-out from 3400 on
}

TEST_CASE("a correctly stamped fallback takes over at the same sample, however late it arrives") {
  for (int64_t late = 0; late <= 50; late += 10) {
    CAPTURE(late);
    ClockSelector clock = three_clocks();
    std::optional<int64_t> took_over;
    for (int64_t now = 1000; now < 1300; now += 10) {
      if (now <= 1100) REQUIRE(clock.offer(kIns, now) == Verdict::kTick);
      const bool ticks = clock.offer(kVo, now - late) == Verdict::kTick;
      if (ticks && !took_over) took_over = now - late;
    }
    REQUIRE(took_over == 1210);
  }
}

TEST_CASE("the third clock waits for the time-outs of both before it") {
  ClockSelector clock = three_clocks();
  clock.offer(kIns, 1000);
  clock.offer(kVo, 1050);
  REQUIRE(clock.offer(kWheel, 1150) == Verdict::kInput);
  REQUIRE(clock.offer(kWheel, 1250) == Verdict::kInput);
  REQUIRE(clock.offer(kWheel, 1251) == Verdict::kTick);
}

TEST_CASE("at the start the first clock has its time-out to appear") {
  ClockSelector clock = three_clocks();
  REQUIRE(clock.offer(kWheel, 1000) == Verdict::kInput);
  REQUIRE(clock.offer(kIns, 1000) == Verdict::kTick);

  ClockSelector without = three_clocks();
  REQUIRE(without.offer(kVo, 1000) == Verdict::kInput);
  REQUIRE(without.offer(kVo, 1100) == Verdict::kInput);
  REQUIRE(without.offer(kVo, 1101) == Verdict::kTick);
}

TEST_CASE("recorded decisions replace the time-outs") {
  ClockSelector clock = three_clocks();
  REQUIRE(clock.offer(kIns, 900, false) == Verdict::kInput);
  REQUIRE(clock.offer(kIns, 1000, true) == Verdict::kTick);
  REQUIRE(clock.offer(kVo, 5000, false) == Verdict::kInput);
  REQUIRE(clock.offer(kIns, 1010, true) == Verdict::kTick);
  REQUIRE(clock.offer(kWheel, 1011, true) == Verdict::kTick);
  REQUIRE(clock.offer(kWheel, 1012, false) == Verdict::kInput);
}

TEST_CASE("a stamp far in the future is refused without side effects") {
  const int64_t leap = ClockSelector::kJump_us;
  ClockSelector clock = three_clocks();
  REQUIRE(clock.offer(kIns, 1000) == Verdict::kTick);
  REQUIRE(clock.offer(kIns, 1000 + leap + 1) == Verdict::kRefused);
  REQUIRE(clock.offer(kIns, 1010) == Verdict::kTick);
  REQUIRE(clock.offer(kVo, 1000 + 50 * leap) == Verdict::kRefused);
  REQUIRE(clock.offer(kVo, 1060) == Verdict::kInput);
  REQUIRE(clock.offer(kVo, 1120) == Verdict::kTick);  // the wild stamps of neither keep it from taking over
  REQUIRE(clock.offer(kIns, 1120 + leap) == Verdict::kTick);
}

TEST_CASE("a gap longer than the jump limit is bridged by the second sample after it") {
  const int64_t leap = ClockSelector::kJump_us;
  ClockSelector clock = three_clocks();
  REQUIRE(clock.offer(kIns, 1000) == Verdict::kTick);
  REQUIRE(clock.offer(kIns, 1000 + 6 * leap) == Verdict::kRefused);
  REQUIRE(clock.offer(kIns, 1000 + 6 * leap) == Verdict::kRefused);  // the same again confirms nothing
  REQUIRE(clock.offer(kIns, 1000 + 9 * leap) == Verdict::kRefused);  // nor does another leap
  ClockSelector restored = three_clocks();
  restored.restore(clock.state());
  for (ClockSelector* c : {&clock, &restored}) {
    REQUIRE(c->offer(kIns, 1010 + 9 * leap) == Verdict::kTick);
    REQUIRE(c->offer(kIns, 1020) == Verdict::kRefused);
  }
  ClockSelector recorded = three_clocks();  // verify takes the ledger's word
  REQUIRE(recorded.offer(kIns, 1000, true) == Verdict::kTick);
  REQUIRE(recorded.offer(kIns, 1010 + 9 * leap, true) == Verdict::kTick);
}

TEST_CASE("a restored selector continues as the saved one") {
  ClockSelector clock = three_clocks();
  clock.offer(kIns, 1000);
  clock.offer(kVo, 1060);
  ClockSelector restored = three_clocks();
  restored.restore(clock.state());
  for (ClockSelector* c : {&clock, &restored}) {
    REQUIRE(c->offer(kVo, 1101) == Verdict::kTick);
    REQUIRE(c->offer(kIns, 1101) == Verdict::kRefused);
    REQUIRE(c->offer(kIns, 1102) == Verdict::kTick);
  }
}
