/// Position from speed and yaw (paper B (10); MODEL.md (M.14) to (M.17)).
#pragma once

#include <Eigen/Dense>

namespace roadfix {

/// kEuler: paper B (10), the old yaw for the whole interval. kArc: a circle, exact for constant speed and yaw rate.
enum class StepForm { kArc, kEuler };

/// One interval of driving.
struct DriveStep {
  double yaw = 0.0;         ///< rad, at its beginning
  double yaw_change = 0.0;  ///< rad
  double distance = 0.0;    ///< m along the path, negative in reverse
  double pitch = 0.0;       ///< rad, nose down
  double side = 0.0;        ///< rad, direction of travel to the left of the vehicle's x: mounting error or crab angle
};

/// Displacement in the level frame (M.15); z falls with the nose.
Eigen::Vector3d displacement(const DriveStep& travel, StepForm form);

/// d displacement / d (yaw, yaw_change, distance, pitch, side), (M.17).
Eigen::Matrix<double, 3, 5> displacement_jacobian(const DriveStep& travel, StepForm form);

}  // namespace roadfix
