#include "stream/clock_selector.h"

#include <algorithm>

namespace roadfix {

/// Rank behind the last clock where it is none.
int ClockSelector::position_of(int input) const {
  int position = 0;
  while (position < static_cast<int>(clocks_.size()) && clocks_[static_cast<std::size_t>(position)].input != input) {
    ++position;
  }
  return position;
}

ClockSelector::Verdict ClockSelector::offer(int input, int64_t utime, std::optional<bool> may_tick) {
  const int position = position_of(input);
  if (position == static_cast<int>(clocks_.size())) return Verdict::kInput;
  if (!may_tick && is_jump(position, utime)) return Verdict::kRefused;
  if (!first_utime_) first_utime_ = utime;
  std::optional<int64_t>& newest = newest_utime_[static_cast<std::size_t>(position)];
  if (!newest || utime > *newest) {
    newest = utime;
    for (std::size_t i = static_cast<std::size_t>(position) + 1; i < clocks_.size(); ++i) since_utime_[i].reset();
  }
  std::optional<int64_t>& since = since_utime_[static_cast<std::size_t>(position)];
  if (!since) since = utime;

  const bool ahead = !utime_ || utime > *utime_;
  const bool preferred = active_ < 0 ? position == 0 : position <= active_;
  const bool takes = position == 0 || (position < active_) || may_take_over(position, utime);
  if (ahead && may_tick.value_or(takes)) {
    changed_ = position != active_ || suspended_;
    suspended_ = false;
    active_ = position;
    utime_ = utime;
    return Verdict::kTick;
  }
  if (ahead && position == active_) suspended_ = true;
  return preferred && !ahead ? Verdict::kRefused : Verdict::kInput;
}

bool ClockSelector::is_jump(int position, int64_t utime) {
  std::optional<int64_t>& last = jump_utime_[static_cast<std::size_t>(position)];
  const bool far_ahead = utime_ && utime - *utime_ > kJump_us;
  if (far_ahead && !confirms_jump(clocks_[static_cast<std::size_t>(position)].input, utime)) {
    last = utime;
    return true;
  }
  last.reset();
  return false;
}

bool ClockSelector::confirms_jump(int input, int64_t utime) const {
  const auto position = static_cast<std::size_t>(position_of(input));
  if (position == clocks_.size() || !utime_ || utime - *utime_ <= kJump_us) return false;
  const std::optional<int64_t>& last = jump_utime_[position];
  return last && utime > *last && utime - *last <= kJump_us;
}

/// A correctly stamped fallback is behind the preferred clock or just ahead of it, and has an interval below two thirds
/// of the time-out: beyond the time-out it has advanced by a third of it. The second condition thus has no effect on
/// it, in either order of arrival.
bool ClockSelector::may_take_over(int position, int64_t utime) const {
  const std::optional<int64_t>& since = since_utime_[static_cast<std::size_t>(position)];
  for (std::size_t i = 0; i < static_cast<std::size_t>(position); ++i) {
    if (utime - newest_utime_[i].value_or(*first_utime_) <= clocks_[i].timeout_us) return false;
    if (!since || utime - *since <= clocks_[i].timeout_us / 3) return false;
  }
  return true;
}

std::optional<int> ClockSelector::active_input() const {
  if (active_ < 0) return std::nullopt;
  return clocks_[static_cast<std::size_t>(active_)].input;
}

void ClockSelector::restore(const State& state) {
  active_ = state.active;
  suspended_ = state.suspended;
  utime_ = state.utime;
  first_utime_ = state.first_utime;
  newest_utime_ = state.newest_utime;
  newest_utime_.resize(clocks_.size());
  jump_utime_ = state.jump_utime;
  jump_utime_.resize(clocks_.size());
  since_utime_ = state.since_utime;
  since_utime_.resize(clocks_.size());
  changed_ = false;
}

}  // namespace roadfix
