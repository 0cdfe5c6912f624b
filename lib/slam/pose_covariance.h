/// Transport of pose covariances between poses. Order: position in the map, rotation in body axes.
#pragma once

#include "geometry/se3.h"
#include "slam/pose_graph.h"

namespace roadfix {

/// Jacobian of the error of a pose after the exactly known motion T_before_now by the error before: attitude error
/// becomes position error. The motion T_camera_vehicle transports from camera to vehicle.
Matrix6d pose_transport_jacobian(const SE3& T_map_before, const SE3& T_before_now);

/// Covariance of a pose after that motion.
Matrix6d transported(const Matrix6d& cov, const SE3& T_map_before, const SE3& T_before_now);

/// The same error of another pose, in its own axes: `cov` of a pose at T_map_a, of one at T_map_b.
Matrix6d at_pose(const Matrix6d& cov, const SE3& T_map_a, const SE3& T_map_b);

/// What `whole` has besides `part`, axis by axis of the pose at T_map_body: each keeps the share of its variance that `part`
/// leaves, none at least, and its correlations.
Matrix6d besides(const Matrix6d& whole, const Matrix6d& part, const SE3& T_map_body);

/// Covariance of a pose after the change of axes S.
Matrix6d rotated(const Matrix6d& cov, const Sim3& S);

}  // namespace roadfix
