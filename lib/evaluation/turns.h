/// Turns of the vehicle, and by how much an estimate misses the angle of each: figure 8 of Ock et al. (2020) for any drive. MODEL.md (E.5.5).
#pragma once

#include <optional>
#include <vector>

#include "evaluation/errors.h"

namespace roadfix {

struct VehicleTurn {
  int64_t begin_us = 0;
  int64_t end_us = 0;
  double angle = 0.0;  ///< rad, to the left positive
};

/// Times in which the reference's yaw rate is above `threshold` (rad/s), joined over pauses of up to a second, that turn by
/// at least `least` (rad). Empty where the reference has no yaw rate.
std::vector<VehicleTurn> vehicle_turns(const Trajectory& reference, double threshold, double least);

/// The angle that the estimate turned, minus the reference's, from a second before to a second after the turn. Nothing where no
/// error is within 0.3 s of either time.
std::optional<double> turn_error(const std::vector<PoseError>& errors, const VehicleTurn& turn);

}  // namespace roadfix
