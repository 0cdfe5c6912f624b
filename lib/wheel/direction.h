/// The sign of wheels that tell only magnitudes: the accelerometer's speed says which way the car pulled away
/// (MODEL.md, section 8).
#pragma once

#include <cstdint>
#include <optional>

namespace roadfix {

struct DirectionState {
  int sign = 0;          ///< +1 forward, -1 reverse, 0 undecided
  bool assumed = false;  ///< forward for lack of evidence
  std::optional<int64_t> undecided_since_us;
};

struct DirectionLimits {
  double evidence = 0.0;  ///< log-likelihood ratio
  double timeout = 0.0;   ///< s
};

/// Takes one magnitude (m/s) against the speed that the accelerometer predicts with the given innovation variance.
/// Below kReversible the sign of a moving car may change.
inline constexpr double kReversible = 0.5;  ///< m/s
void add_magnitude(DirectionState& d, const DirectionLimits& limits, int64_t t_us, double magnitude, double predicted,
                   double variance);

}  // namespace roadfix
