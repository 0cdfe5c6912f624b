/// Sign of unsigned wheel speeds: a likelihood ratio test against the speed predicted from the accelerometer, (W.8.1).
#pragma once

#include <cstdint>
#include <optional>

namespace roadfix {

struct DirectionState {
  int sign = 0;          ///< +1 forward, -1 reverse, 0 undecided
  bool assumed = false;  ///< forward was assumed because no evidence was available
  std::optional<int64_t> undecided_since_us;
};

struct DirectionLimits {
  double evidence = 0.0;  ///< log-likelihood ratio required for a decision
  double timeout = 0.0;   ///< s, after which forward is assumed
};

/// Updates the sign with one speed magnitude (m/s), the predicted speed and the innovation variance. The sign of a
/// moving vehicle may change only below vehicle::kSignKnown.
void update_direction(DirectionState& d, const DirectionLimits& limits, int64_t t_us, double magnitude,
                      double predicted, double variance);

}  // namespace roadfix
