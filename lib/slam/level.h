/// Turning a map to the horizon. MODEL.md (M.21).
#pragma once

#include "geometry/se3.h"

namespace roadfix {

/// The least turn that makes the map's axes level, where the vehicle has the attitude q_map_vehicle in the map and
/// q_level_vehicle against axes of which z is up; yaw of either does not count.
Eigen::Quaterniond turn_to_level(const Eigen::Quaterniond& q_map_vehicle, const Eigen::Quaterniond& q_level_vehicle);

/// A map's turn about a point in it, which stays.
struct LevelTurn {
  Eigen::Quaterniond q = Eigen::Quaterniond::Identity();
  Eigen::Vector3d pivot = Eigen::Vector3d::Zero();
  double sigma = 0.0;  ///< rad, of either horizontal axis after it

  [[nodiscard]] SE3 transform() const { return {q, pivot - q * pivot}; }
  /// Covariance of a camera's pose after the turn, T_map_camera: what was known of it before, and how well the horizon
  /// is.
  [[nodiscard]] Matrix6d covariance(const Matrix6d& before, const SE3& T_map_camera) const;
};

}  // namespace roadfix
