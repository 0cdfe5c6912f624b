/// Selects the channel that drives a stage's time: the first of the list that has not timed out. Time-outs are in data
/// time, so that a time-out requires another clock channel to continue: its stamps must exceed the time-out and have
/// advanced by a third of it since the last sample of a preferred clock, so that stamps that run ahead cause no false
/// time-out. When a preferred clock returns, its fallback is suspended until the preferred one is ahead. A sample more
/// than 10 s ahead of the clock may have a wrong stamp, which would make every later one too old: it is refused until
/// the next of its channel confirms it.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "stream/spec.h"

namespace roadfix {

class ClockSelector {
 public:
  explicit ClockSelector(std::vector<ClockSpec> clocks)
      : clocks_(std::move(clocks)),
        newest_utime_(clocks_.size()),
        since_utime_(clocks_.size()),
        jump_utime_(clocks_.size()) {}

  enum class Verdict {
    kInput,   ///< not the clock now: an ordinary input
    kTick,    ///< the stage's time moves to it
    kRefused  ///< older than the clock and out of order, or far ahead of it
  };

  /// A sample of `input`. `may_tick` overrides the time-outs with a recorded decision.
  Verdict offer(int input, int64_t utime, std::optional<bool> may_tick = std::nullopt);

  /// Whether offer() would accept this sample far ahead of the clock, because the previous one was refused as a jump.
  [[nodiscard]] bool confirms_jump(int input, int64_t utime) const;

  /// Whether the last kTick changed the clock channel or ended a suspension (the first tick counts).
  [[nodiscard]] bool changed() const { return changed_; }
  [[nodiscard]] std::optional<int64_t> utime() const { return utime_; }
  [[nodiscard]] std::optional<int> active_input() const;

  struct State {
    int active = -1;
    bool suspended = false;
    std::optional<int64_t> utime;
    std::optional<int64_t> first_utime;
    std::vector<std::optional<int64_t>> newest_utime;
    std::vector<std::optional<int64_t>> jump_utime;
    std::vector<std::optional<int64_t>> since_utime;
  };
  [[nodiscard]] State state() const {
    return {active_, suspended_, utime_, first_utime_, newest_utime_, jump_utime_, since_utime_};
  }
  void restore(const State& state);

  static constexpr int64_t kJump_us = 10'000'000;

 private:
  [[nodiscard]] int position_of(int input) const;
  [[nodiscard]] bool is_jump(int position, int64_t utime);
  [[nodiscard]] bool may_take_over(int position, int64_t utime) const;

  std::vector<ClockSpec> clocks_;
  int active_ = -1;
  bool changed_ = false;
  bool suspended_ = false;  // the active clock skipped a sample since its last tick
  std::optional<int64_t> utime_;
  std::optional<int64_t> first_utime_;  // of any clock channel: start of the first clock's initial time-out
  std::vector<std::optional<int64_t>> newest_utime_;
  std::vector<std::optional<int64_t>> since_utime_;  // of the first sample after the last one of a preferred clock
  std::vector<std::optional<int64_t>> jump_utime_;   // of the last sample, if refused as a jump
};

}  // namespace roadfix
