/// Takes the jitter out of a camera's stamps: the device exposes at an even rate, the stamps tell when a computer got
/// round to it.
///
/// A least-squares line over the frames so far, with a memory that ends (so that a slow drift of the two clocks is
/// followed): t_k = phase + k period. Frames that were skipped count as many periods as they took.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "stream/state_bytes.h"

namespace roadfix {

class StampFilter {
 public:
  /// `rate_hz`: the device's, as far as known; absent: learnt from the first frames.
  explicit StampFilter(std::optional<double> rate_hz);

  /// The time of the frame with this stamp; later than the one before. A stamp that is off by more than half a period
  /// for some frames in a row begins a new line.
  int64_t filter(int64_t stamp_us);

  [[nodiscard]] double period_s() const { return period_us_ * 1e-6; }

  void save(StateWriter& writer) const;
  void load(StateReader& reader);

 private:
  void begin(int64_t stamp_us);
  int64_t learn(int64_t stamp_us);

  double nominal_us_;  ///< 0 where nothing is known
  double period_us_ = 0.0;
  int64_t origin_us_ = 0;          ///< the line's times are relative to it: a double holds them exactly enough
  double last_us_ = 0.0;           ///< on the line
  int64_t frames_ = 0;             ///< since the line began
  int strays_ = 0;                 ///< frames in a row far off it
  int64_t given_us_ = 0;           ///< the last result
  std::vector<int64_t> first_us_;  ///< stamps from which an unknown period is learnt
};

}  // namespace roadfix
