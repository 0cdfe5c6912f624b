/// Covariances of poses carried from one pose to another. Order: position in the map, rotation in body axes.
#pragma once

#include "geometry/se3.h"
#include "slam/pose_graph.h"

namespace roadfix {

/// d error of a pose after the motion T_before_now, which is known exactly / d error before: attitude error becomes
/// position error. A camera's pose becomes the vehicle's by the motion T_camera_vehicle.
Matrix6d carried_by(const SE3& T_map_before, const SE3& T_before_now);

/// Covariance of a pose after that motion.
Matrix6d carried(const Matrix6d& cov, const SE3& T_map_before, const SE3& T_before_now);

/// Covariance of a pose after the change of axes S.
Matrix6d in_map(const Matrix6d& cov, const Sim3& S);

}  // namespace roadfix
