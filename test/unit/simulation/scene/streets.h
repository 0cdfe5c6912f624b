/// Streets, cameras and places that the scene tests share.
#pragma once

#include <cmath>

#include "simulation/scene/render.h"
#include "simulation/scene/street.h"

namespace roadfix::test {

inline Executor& inline_executor() {
  static InlineExecutor executor;
  return executor;
}

/// A line of way: lengths and turns (rad), from the origin to the east.
inline std::vector<Eigen::Vector3d> way(const std::vector<std::pair<double, double>>& legs) {
  std::vector<Eigen::Vector3d> points{Eigen::Vector3d::Zero()};
  double yaw = 0.0;
  for (const auto& [length, turn] : legs) {
    for (double d = 0.5; d <= length; d += 0.5) {
      yaw += 0.5 * turn / length;
      points.emplace_back(points.back() + 0.5 * Eigen::Vector3d(std::cos(yaw), std::sin(yaw), 0.0));
    }
  }
  return points;
}

inline StreetPlan street(StreetKind kind = StreetKind::kStreet, std::uint64_t seed = 1) {
  StreetPlan plan;
  plan.driven = way({{250.0, 0.0}, {60.0, 0.8}, {100.0, 0.0}});
  plan.segments = {{0.0, kind}};
  plan.seed = seed;
  return plan;
}

inline CameraIntrinsics lens(int width, int height) {
  CameraIntrinsics c;
  c.width = width;
  c.height = height;
  c.fx = c.fy = 0.58 * width;
  c.cx = 0.5 * width - 3.3;
  c.cy = 0.5 * height + 2.7;
  c.distortion = Distortion::kRadTan;
  c.coefficients = {-0.28, 0.09, 4e-4, -3e-4, 0.0};
  return c;
}

/// A camera 1.6 m above the plan's point i, looking along the way, driving.
inline View view_at(const StreetPlan& plan, std::size_t i, double speed = 12.0) {
  const Eigen::Vector3d forward = (plan.driven[i + 1] - plan.driven[i]).normalized();
  const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d R;
  R << right, forward.cross(right), forward;
  View v;
  v.t_s = 0.5 * static_cast<double>(i) / speed;
  v.T_enu_camera = {Eigen::Quaterniond(R), plan.driven[i] + Eigen::Vector3d(0.0, 0.0, 1.6)};
  v.velocity_enu = speed * forward;
  return v;
}

inline LightField draw(const World& world, const Camera& camera, const View& view,
                       Executor& executor = inline_executor()) {
  RayScene scene(world);
  LightField light;
  Renderer(world, camera).render(scene, view, executor, light);
  return light;
}

}  // namespace roadfix::test
