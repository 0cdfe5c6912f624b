/// The utime of one run: the monotonic clock plus an offset that is fixed when the run starts and slewed towards the
/// wall clock by at most 100 ppm, so that a step of the wall clock never reaches a message.
#pragma once

#include <cstdint>

namespace roadfix {

class SlewedOffset {
 public:
  static constexpr int64_t kMaxSlew_ppm = 100;

  SlewedOffset(int64_t monotonic_us, int64_t wall_us) : offset_us_(wall_us - monotonic_us), last_us_(monotonic_us) {}

  /// utime at `monotonic_us`, which never runs backwards.
  int64_t utime(int64_t monotonic_us, int64_t wall_us);

  /// How far the wall clock is ahead of utime; what slewing has not caught up yet.
  [[nodiscard]] int64_t behind_us(int64_t monotonic_us, int64_t wall_us) const {
    return wall_us - (monotonic_us + offset_us_);
  }

 private:
  int64_t offset_us_;
  int64_t last_us_;
  int64_t unused_ps_ = 0;  // slew not yet worth a microsecond
};

/// Reads the system's clocks. For drivers, heartbeats and the like; stages take time from their inputs.
class RunClock {
 public:
  RunClock();
  [[nodiscard]] int64_t now_utime();
  [[nodiscard]] int64_t run() const { return run_; }  ///< utime of construction

 private:
  SlewedOffset offset_;
  int64_t run_;
};

}  // namespace roadfix
