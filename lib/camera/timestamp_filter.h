/// Smooths camera timestamps: the device exposes at a constant rate, while the stamps include the host's latency
/// jitter.
///
/// Recursive least-squares line over the frames with a limited window (so that clock drift is followed): t_k = phase +
/// k period, MODEL.md (K.3.1), (K.3.2). Skipped frames count as whole periods.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "stream/state_bytes.h"

namespace roadfix {

class TimestampFilter {
 public:
  /// `rate_hz`: nominal rate of the device; without it, the rate is estimated from the first frames.
  explicit TimestampFilter(std::optional<double> rate_hz);

  /// Smoothed time of the frame with this stamp; strictly increasing. After several successive stamps that are off by
  /// more than half a period the line restarts.
  int64_t filter(int64_t stamp_us);

  [[nodiscard]] double period_s() const { return period_us_ * 1e-6; }

  void save(StateWriter& writer) const;
  void load(StateReader& reader);

 private:
  void restart(int64_t stamp_us);
  int64_t estimate_period(int64_t stamp_us);

  double nominal_us_;  ///< 0: not known
  double period_us_ = 0.0;
  int64_t origin_us_ = 0;            ///< reference time of the line, so that a double resolves it
  double last_us_ = 0.0;             ///< smoothed time of the last frame
  int64_t frames_ = 0;               ///< since the line started
  int outliers_ = 0;                 ///< successive frames far off the line
  int64_t output_us_ = 0;            ///< last result
  std::vector<int64_t> initial_us_;  ///< stamps for the estimate of an unknown period
};

}  // namespace roadfix
