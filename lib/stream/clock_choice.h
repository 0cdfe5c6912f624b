/// Which channel drives a stage's time. The first of the list that is not silent; time-outs are in data time, so a
/// silence shows only when another clock channel goes on: its stamps must be past the time-out, and have moved by a
/// third of it since a preferred clock came last, so that one whose stamps run ahead makes nobody silent. When a
/// preferred clock comes back, the one that stood in for it rests, so that the preferred one can get ahead of it. A
/// sample that leaps more than 10 s ahead of the clock may be a broken stamp, behind which every true one would be too
/// old: it is refused until the next of its channel confirms it.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "stream/spec.h"

namespace roadfix {

class ClockChoice {
 public:
  explicit ClockChoice(std::vector<ClockSpec> clocks)
      : clocks_(std::move(clocks)),
        newest_utime_(clocks_.size()),
        since_utime_(clocks_.size()),
        leap_utime_(clocks_.size()) {}

  enum class Verdict {
    kInput,   ///< not a clock now: an input like any other
    kTick,    ///< the stage's time moves to it
    kRefused  ///< older than the clock, so that it can no longer be taken in order; or far ahead of it
  };

  /// A sample of `input`. `may_tick` overrides the time-outs: a recorded ledger knows what ticked.
  Verdict offer(int input, int64_t utime, std::optional<bool> may_tick = std::nullopt);

  /// Whether offer() would take this sample, far ahead of the clock, because one before it was refused as that.
  [[nodiscard]] bool confirms_leap(int input, int64_t utime) const;

  /// Whether the last kTick came from another channel than the tick before it, or after a rest (the first tick counts).
  [[nodiscard]] bool changed() const { return changed_; }
  [[nodiscard]] std::optional<int64_t> utime() const { return utime_; }
  [[nodiscard]] std::optional<int> active_input() const;

  struct State {
    int active = -1;
    bool rested = false;
    std::optional<int64_t> utime;
    std::optional<int64_t> first_utime;
    std::vector<std::optional<int64_t>> newest_utime;
    std::vector<std::optional<int64_t>> leap_utime;
    std::vector<std::optional<int64_t>> since_utime;
  };
  [[nodiscard]] State state() const {
    return {active_, rested_, utime_, first_utime_, newest_utime_, leap_utime_, since_utime_};
  }
  void restore(const State& state);

  static constexpr int64_t kLeap_us = 10'000'000;

 private:
  [[nodiscard]] int position_of(int input) const;
  [[nodiscard]] bool leaps(int position, int64_t utime);
  [[nodiscard]] bool may_take_over(int position, int64_t utime) const;

  std::vector<ClockSpec> clocks_;
  int active_ = -1;
  bool changed_ = false;
  bool rested_ = false;  // the active clock passed over a sample since its last tick
  std::optional<int64_t> utime_;
  std::optional<int64_t> first_utime_;  // of any clock channel: until its time-out after it, the first clock may begin
  std::vector<std::optional<int64_t>> newest_utime_;
  std::vector<std::optional<int64_t>> since_utime_;  // of the first one after a preferred clock's last
  std::vector<std::optional<int64_t>> leap_utime_;   // of the last sample, where it was refused as a leap
};

}  // namespace roadfix
