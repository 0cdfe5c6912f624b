/// Covariances of poses carried from one pose to another. Order: position in the map, rotation in body axes.
#pragma once

#include "geometry/se3.h"
#include "slam/pose_graph.h"

namespace roadfix {

/// How a camera pose's covariance becomes the vehicle's: the lever arm turns attitude error into position error.
Matrix6d vehicle_covariance(const Matrix6d& cov_camera, const SE3& T_map_camera, const SE3& T_camera_vehicle);

/// Covariance of a pose after the motion T_before_now, which is known exactly: attitude error becomes position error.
Matrix6d carried(const Matrix6d& cov, const SE3& T_map_before, const SE3& T_before_now);

/// Covariance of a pose after the change of axes S.
Matrix6d in_map(const Matrix6d& cov, const Sim3& S);

}  // namespace roadfix
