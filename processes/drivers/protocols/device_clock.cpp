#include "drivers/protocols/device_clock.h"

#include <algorithm>

namespace roadfix {

namespace {

/// No path is that late, and no two clocks part by it between two messages.
constexpr int64_t kJump_us = 2'000'000;
/// Stamps of one device may come out of order by the delay of its slowest message.
constexpr int64_t kBackwards_us = 1'000'000;
/// So many stamps in a row that fit together but not with the offset.
constexpr int kStraysForRestart = 3;
/// No path becomes that much slower for good: a serial port's buffer of 4 kB holds 0.35 s at 115200 baud.
constexpr int64_t kLate_us = 500'000;
constexpr int64_t kPersistentlyLate_us = 10'000'000;
/// Beyond it sums would overflow; no clock shows it.
constexpr int64_t kLimit_us = int64_t{1} << 61;
/// After a longer silence the two clocks' distance is learnt from what comes, not from how far they may have parted.
constexpr int64_t kMaxSilence_us = int64_t{3600} * 1'000'000;

}  // namespace

std::optional<int64_t> DeviceClock::begin(int64_t device_us, int64_t read_utime) {
  if (known_) ++restarts_;
  known_ = true;
  strays_ = 0;
  late_since_us_.reset();
  creep_ps_ = 0;
  offset_us_ = read_utime - device_us;
  newest_device_us_ = device_us;
  return read_utime;
}

std::optional<int64_t> DeviceClock::utime(int64_t device_us, int64_t read_utime) {
  const auto possible = [](int64_t t_us) { return -kLimit_us < t_us && t_us < kLimit_us; };
  if (!possible(device_us) || !possible(read_utime)) return std::nullopt;
  if (!known_) return begin(device_us, read_utime);
  const int64_t seen_us = read_utime - device_us;
  if (device_us < newest_device_us_ - kBackwards_us || seen_us < offset_us_ - kJump_us) {
    return ++strays_ < kStraysForRestart ? std::nullopt : begin(device_us, read_utime);
  }
  strays_ = 0;
  creep_ps_ += std::clamp<int64_t>(device_us - newest_device_us_, 0, kMaxSilence_us) * kCreep_ppm;
  newest_device_us_ = std::max(newest_device_us_, device_us);
  const int64_t creep_us = creep_ps_ / 1'000'000;
  creep_ps_ -= creep_us * 1'000'000;
  offset_us_ = std::min(offset_us_ + creep_us, seen_us);
  if (was_set_back(seen_us, read_utime)) {
    ++restarts_;
    newest_device_us_ = device_us;
    offset_us_ = least_late_us_;
  }
  return device_us + offset_us_;
}

bool DeviceClock::was_set_back(int64_t seen_us, int64_t read_utime) {
  if (seen_us - offset_us_ < kLate_us) {
    late_since_us_.reset();
    return false;
  }
  if (!late_since_us_) {
    late_since_us_ = read_utime;
    least_late_us_ = seen_us;
  }
  least_late_us_ = std::min(least_late_us_, seen_us);
  if (read_utime - *late_since_us_ < kPersistentlyLate_us) return false;
  late_since_us_.reset();
  return true;
}

int64_t WrappingClock::unwrap(uint32_t stamp_us) {
  if (!known_) {
    known_ = true;
    return last_us_ = stamp_us;
  }
  const auto step = static_cast<int32_t>(stamp_us - static_cast<uint32_t>(last_us_));
  const int64_t t_us = last_us_ + step;
  last_us_ = std::max(last_us_, t_us);
  if (step < -1'000'000) last_us_ = t_us;  // switched on anew: the next stamps follow this one
  return t_us;
}

}  // namespace roadfix
