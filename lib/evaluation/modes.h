/// Does the fusion's likelier motion model match what the car does? Lee et al. (2025), (13), and the two figures without which it
/// misleads: always answering "no turn" scores high on any drive, so a balanced rate stands beside it.
#pragma once

#include <optional>
#include <vector>

#include "evaluation/trajectory.h"

namespace roadfix {

struct ModeSample {
  int64_t t_us = 0;
  double turn_probability = 0.0;  ///< of the constant-turn mode; above one half it is the selected one
};

struct ModeAccuracy {
  double threshold = 0.0;                ///< rad/s, the yaw rate that counts as a turn
  double percent = 0.0;                  ///< MPA, (13)
  double balanced_percent = 0.0;         ///< mean of both classes' hit rates; the one that occurs where only one does
  double always_straight_percent = 0.0;  ///< MPA of an estimator that never predicts a turn
  int samples = 0;
  int turns = 0;
};

/// Yaw rate of the reference at its poses' times, rad/s: from its attitude, or from the course of its velocity (above 2
/// m/s) where it has none. Times without an answer are left out.
std::vector<std::pair<int64_t, double>> yaw_rates(const Trajectory& reference);

/// Nothing where no sample has a reference yaw rate.
std::optional<ModeAccuracy> mode_accuracy(const std::vector<ModeSample>& modes, const Trajectory& reference,
                                          double threshold_radps);

}  // namespace roadfix
