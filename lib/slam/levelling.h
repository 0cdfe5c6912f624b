/// Levelling of a map. MODEL.md (S.14.1).
#pragma once

#include "geometry/se3.h"

namespace roadfix {

/// Smallest rotation that levels the map's axes, given the attitude of the vehicle in the map and relative to axes with
/// z up; independent of both yaws.
Eigen::Quaterniond levelling_rotation(const Eigen::Quaterniond& q_map_vehicle,
                                      const Eigen::Quaterniond& q_level_vehicle);

/// Rotation of a map about a fixed point.
struct LevellingRotation {
  Eigen::Quaterniond q = Eigen::Quaterniond::Identity();
  Eigen::Vector3d pivot = Eigen::Vector3d::Zero();
  double sigma = 0.0;  ///< rad, of either horizontal axis after the rotation

  [[nodiscard]] SE3 transform() const { return {q, pivot - q * pivot}; }
  /// Covariance of a camera's pose T_map_camera after the rotation: the previous one and the levelling error.
  [[nodiscard]] Matrix6d covariance(const Matrix6d& before, const SE3& T_map_camera) const;
};

}  // namespace roadfix
