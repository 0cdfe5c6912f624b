#include "simulation/scene/drive_scene.h"

#include <cmath>

#include "geometry/frames.h"
#include "simulation/scenarios.h"
#include "simulation/sensors.h"

namespace roadfix {
namespace {

constexpr double kStep_s = 0.04;     // between the points of the path: 1.5 m at 130 km/h
constexpr double kShortest_m = 2.5;  // a path that has a direction

StreetPlan plan_of(const SimulatedDrive& drive) {
  const SceneConfig& scene = drive.config.scene;
  StreetPlan plan;
  plan.seed = stream_of(drive, NoiseStream::kScene).bits();
  plan.moving_cars = scene.moving_cars;
  plan.sun_azimuth = scene.sun_azimuth_deg * kDegree;
  plan.sun_elevation = scene.sun_elevation_deg * kDegree;
  double driven_m = 0.0;
  std::size_t next = 0;
  const int steps = static_cast<int>(drive.config.duration_s / kStep_s);
  for (int i = 0; i <= steps; ++i) {
    const double t_s = i * kStep_s;
    const Kinematics k = drive.motion->at(t_s);
    Eigen::Vector3d p = k.T_enu_vehicle.p;
    p.z() = terrain_at(p.head<2>(), drive.config.motion.hill_factor).height;  // the car heaves, its street does not
    if (!plan.driven.empty()) driven_m += (p - plan.driven.back()).norm();
    plan.driven.push_back(p);
    while (next < scene.segments.size() && scene.segments[next].begin_s <= t_s) {
      const double begin_m = plan.segments.empty() ? 0.0 : std::max(driven_m, plan.segments.back().begin_m + 1.0);
      plan.segments.push_back({begin_m, scene.segments[next++].kind});
    }
  }
  if (driven_m < kShortest_m) {
    const Eigen::Vector3d forward = drive.motion->at(0.0).T_enu_vehicle.q * Eigen::Vector3d::UnitX();
    plan.driven.emplace_back(plan.driven.back() + kShortest_m * forward);
  }
  return plan;
}

}  // namespace

World world_of(const SimulatedDrive& drive) { return build_world(plan_of(drive)); }

SimulatedRig rig_of(const SimulatedDrive& drive) {
  const CameraConfig& c = drive.config.camera;
  const SE3& T_vehicle_left = drive.errors.T_vehicle_left;
  return {Camera(intrinsics_of(c)), T_vehicle_left, T_vehicle_left * T_left_right(c)};
}

View view_at(const SimulatedDrive& drive, const SE3& T_vehicle_camera, std::int64_t true_us) {
  const Kinematics k = drive.kinematics_at(true_us);
  View view;
  view.t_s = seconds_between(drive.config.start_utime, true_us);
  view.T_enu_camera = k.T_enu_vehicle * T_vehicle_camera;
  view.velocity_enu = k.velocity_enu + k.T_enu_vehicle.q * k.angular_rate.cross(T_vehicle_camera.p);
  view.angular_rate = T_vehicle_camera.q.conjugate() * k.angular_rate;
  return view;
}

}  // namespace roadfix
