#include "bus/run/run_clock.h"

#include <time.h>

#include <algorithm>

namespace roadfix {

namespace {

int64_t read_us(clockid_t clock) {
  timespec now{};
  ::clock_gettime(clock, &now);
  return int64_t{now.tv_sec} * 1'000'000 + now.tv_nsec / 1000;
}

}  // namespace

int64_t SlewedOffset::utime(int64_t monotonic_us, int64_t wall_us) {
  unused_ps_ += std::max<int64_t>(monotonic_us - last_us_, 0) * kMaxSlew_ppm;
  last_us_ = std::max(last_us_, monotonic_us);
  const int64_t allowed_us = unused_ps_ / 1'000'000;
  const int64_t step_us = std::clamp(behind_us(monotonic_us, wall_us), -allowed_us, allowed_us);
  offset_us_ += step_us;
  unused_ps_ -= allowed_us * 1'000'000;
  return monotonic_us + offset_us_;
}

RunClock::RunClock() : offset_(read_us(CLOCK_MONOTONIC), read_us(CLOCK_REALTIME)), run_(now_utime()) {}

int64_t RunClock::now_utime() { return offset_.utime(read_us(CLOCK_MONOTONIC), read_us(CLOCK_REALTIME)); }

}  // namespace roadfix
