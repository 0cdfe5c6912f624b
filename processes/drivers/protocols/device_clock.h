/// A device's own clock on the time line of the computer's utime (docs/DESIGN.md, section 4).
///
/// utime = device time + offset. Reading comes some delay after the device's stamp, so (read utime - device time) is
/// the offset plus that delay, and its smallest values show the offset. The estimate is a running minimum that creeps
/// upwards as fast as two clocks may part, so that it follows either: late readings do not move it, early ones do at
/// once. What remains is the least delay of the path, for which a driver has its `latency_s`. (The lower envelope as in
/// Moon, Skelly, Towsley, Estimation and removal of clock skew from network delay measurements, 1999, without the
/// line.) A device's clock that was set back by less than stamps may be out of order, as by a leap second, looks like a
/// path that became slower: what stays that late for ten seconds is the new offset.
#pragma once

#include <cstdint>
#include <optional>

namespace roadfix {

class DeviceClock {
 public:
  /// Two quartzes at 100 ppm each, and 100 ppm that utime is slewed by at most.
  static constexpr int64_t kCreep_ppm = 300;

  /// The moment at which the device's clock showed `device_us`, read at `read_utime`. Absent for a stamp that jumped:
  /// one is an error and refused; when it stays, the device's clock was set anew, and so is the offset.
  std::optional<int64_t> utime(int64_t device_us, int64_t read_utime);

  /// The device was opened anew: its clock may be another.
  void restart() { known_ = false; }

  [[nodiscard]] int64_t restarts() const { return restarts_; }

 private:
  std::optional<int64_t> begin(int64_t device_us, int64_t read_utime);
  /// Whether every reading has been late for so long that the device's clock must have been set back.
  bool was_set_back(int64_t seen_us, int64_t read_utime);

  bool known_ = false;
  int64_t offset_us_ = 0;
  int64_t newest_device_us_ = 0;
  int64_t creep_ps_ = 0;  ///< not yet worth a microsecond
  int strays_ = 0;
  std::optional<int64_t> late_since_us_;  ///< when the readings became late
  int64_t least_late_us_ = 0;             ///< the smallest offset seen since
  int64_t restarts_ = 0;
};

/// Continues a counter of microseconds that wraps at 2^32 (after 71.6 min). Stamps may come in any order within 35 min.
class WrappingClock {
 public:
  int64_t unwrap(uint32_t stamp_us);

 private:
  bool known_ = false;
  int64_t last_us_ = 0;
};

}  // namespace roadfix
