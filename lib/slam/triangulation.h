/// A point from the rays that saw it.
#pragma once

#include <optional>
#include <span>

#include "geometry/se3.h"

namespace roadfix {

struct Ray {
  Eigen::Vector3d origin;     ///< m, in the map
  Eigen::Vector3d direction;  ///< unit, in the map
};

/// Ray of normalised coordinates seen from a pose.
Ray ray(const SE3& T_map_eye, const Eigen::Vector2d& normalised);

/// The point nearest to all rays, least squares. Nothing where no two rays open an angle of `min_angle`, rad, or where
/// the point is not in front of every origin.
std::optional<Eigen::Vector3d> triangulate(std::span<const Ray> rays, double min_angle);

}  // namespace roadfix
