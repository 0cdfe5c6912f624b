/// Puts together what a receiver says of one moment in several messages: position, velocity, accuracy, heading.
///
/// Which parts to wait for is learnt from the stream: a fix goes out as soon as all parts that came in the last epochs
/// are there, when the next epoch begins, or when it has waited for kHold_us.
#pragma once

#include <cstdint>
#include <vector>

#include "samples/samples.h"

namespace roadfix {

class GnssEpochs {
 public:
  /// Below the lateness of 250 ms that the filter grants to GNSS.
  static constexpr int64_t kHold_us = 100'000;
  enum Part { kPosition = 0, kVelocity, kAccuracy, kHeading, kParts };

  /// The fix of the epoch with this key (a time of week or of day), to be filled; then mark() what was. Null for an
  /// epoch that went out already: this part is late, and will be waited for the next time.
  GnssFix* part(int64_t key, Part part, int64_t read_utime);
  /// The newest epoch's key, for messages that carry no time; -1 before the first.
  [[nodiscard]] int64_t key() const { return key_; }
  [[nodiscard]] bool has(Part part) const { return open_ && (parts_ & (1U << part)) != 0; }

  /// The part that part() was called for is filled.
  void mark(Part part);
  /// The epoch with this key has no more parts.
  void end(int64_t key);
  /// Lets go what has waited too long.
  void wait(int64_t read_utime);
  /// The device was opened anew.
  void reset();

  /// Fixes that are whole, oldest first. Only those that have a position, within fix_limits.h.
  std::vector<GnssFix> take();

  /// Parts that no receiver can mean.
  [[nodiscard]] int64_t refused() const { return refused_; }

 private:
  void close();

  int64_t key_ = -1;
  bool open_ = false;
  int64_t since_us_ = 0;
  unsigned parts_ = 0;
  unsigned expected_ = 0;
  int missed_[kParts] = {};
  int64_t refused_ = 0;
  GnssFix fix_;
  std::vector<GnssFix> whole_;
};

}  // namespace roadfix
