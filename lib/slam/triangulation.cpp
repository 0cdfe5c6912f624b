#include "slam/triangulation.h"

#include <cmath>

namespace roadfix {

Ray ray(const SE3& T_map_eye, const Eigen::Vector2d& normalised) {
  return {T_map_eye.p, T_map_eye.q * normalised.homogeneous().normalized()};
}

std::optional<Eigen::Vector3d> triangulate(std::span<const Ray> rays, double min_angle) {
  if (rays.size() < 2) return std::nullopt;
  double widest = 0.0;
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (const Ray& r : rays) {
    widest = std::max(widest, rays.front().direction.cross(r.direction).norm());
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - r.direction * r.direction.transpose();
    A += across;
    b += across * r.origin;
  }
  if (widest < std::sin(min_angle)) return std::nullopt;
  const Eigen::Vector3d p = A.ldlt().solve(b);
  for (const Ray& r : rays) {
    if (!((p - r.origin).dot(r.direction) > 0.0)) return std::nullopt;
  }
  return p;
}

}  // namespace roadfix
