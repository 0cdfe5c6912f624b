/// Dead reckoning: position from speed and yaw (Ock et al. 2020, equation 10; MODEL.md (W.4.1) to (W.4.4)).
#pragma once

#include <Eigen/Dense>

namespace roadfix {

/// kEuler: Ock et al. 2020 (10), constant yaw over the interval. kArc: circular arc, exact for constant speed and yaw
/// rate.
enum class StepForm { kArc, kEuler };

/// One propagation interval.
struct ArcStep {
  double yaw = 0.0;         ///< rad, at the start of the interval
  double yaw_change = 0.0;  ///< rad
  double distance = 0.0;    ///< m along the path, negative in reverse
  double pitch = 0.0;       ///< rad, nose down
  double crab_angle = 0.0;  ///< rad, direction of travel to the left of the vehicle's x: mounting yaw or sideslip
};

/// Displacement in the level frame (W.4.2); negative z when the nose points down.
Eigen::Vector3d displacement(const ArcStep& step, StepForm form);

/// d displacement / d (yaw, yaw_change, distance, pitch, crab_angle), (W.4.4).
Eigen::Matrix<double, 3, 5> displacement_jacobian(const ArcStep& step, StepForm form);

}  // namespace roadfix
