/// Triangulation of a point from several rays.
#pragma once

#include <optional>
#include <span>

#include "geometry/se3.h"

namespace roadfix {

struct Ray {
  Eigen::Vector3d origin;     ///< m, in the map
  Eigen::Vector3d direction;  ///< unit, in the map
};

/// Ray of normalised coordinates at a pose.
Ray ray(const SE3& T_map_eye, const Eigen::Vector2d& normalised);

/// Least-squares intersection of all rays. No value where no two rays enclose `min_angle`, rad, or where the point is
/// behind an origin.
std::optional<Eigen::Vector3d> triangulate(std::span<const Ray> rays, double min_angle);

}  // namespace roadfix
