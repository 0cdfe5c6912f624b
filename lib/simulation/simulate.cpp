#include "simulation/simulate.h"

#include <cmath>

#include "geometry/frames.h"
#include "simulation/rough_road.h"
#include "simulation/scenarios.h"
#include "simulation/sensors.h"

namespace roadfix {
namespace {

constexpr double kKnot_s = 0.05;  // of the spline that is the truth
constexpr int kLead = 40;         // knots before the start and after the end: smoothing and latency reach there

/// Angles of a car on a slope that leans with its accelerations and slips sideways on its rear tyres, (D.1.2).
PoseCoordinates coordinates(const Eigen::Vector3d& pose, double acceleration, double lateral, double direction,
                            const MotionConfig& c) {
  const Terrain ground = terrain_at(pose.head<2>(), c.hill_factor);
  const double yaw = pose.z() + direction * c.rear_slip_rad_per_mps2 * lateral;
  const Eigen::Vector2d forward(std::cos(yaw), std::sin(yaw));
  const Eigen::Vector2d left(-forward.y(), forward.x());
  const double pitch = -std::atan(ground.slope.dot(forward)) - c.pitch_rad_per_mps2 * acceleration;
  const double roll = std::atan(ground.slope.dot(left)) + c.roll_rad_per_mps2 * lateral;
  PoseCoordinates x;
  x << pose.x(), pose.y(), ground.height, yaw, pitch, roll;
  return x;
}

Motion drive_route(const SimulatedDrive& drive) {
  const ScenarioConfig& config = drive.config;
  const MotionConfig& c = config.motion;
  const int count = static_cast<int>(std::ceil(config.duration_s / kKnot_s)) + 2 * kLead + 1;
  std::vector<WayPoint> points = way_points(c.route, config.duration_s + 2.0 * kLead * kKnot_s);
  for (WayPoint& p : points) p.speed_limit *= c.speed_factor;
  const Path path = path_through(points);
  const Limits limits{c.acceleration_mps2, c.braking_mps2, c.lateral_mps2};
  const std::vector<double> distance = travelled(path, limits, start_speed(c.route) * c.speed_factor, kKnot_s, count);
  const std::vector<Eigen::Vector3d> poses = poses_along(path, distance);
  const RoughRoad road(c.road_roughness_m3, config.wheels.wheelbase_m, config.wheels.track_width_m,
                       stream_of(drive, NoiseStream::kRoad));
  std::vector<PoseCoordinates> samples;
  samples.reserve(poses.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const std::size_t a = i == 0 ? 0 : i - 1;
    const std::size_t b = std::min(i + 1, poses.size() - 1);
    const double direction = std::cos(poses[i].z()) * (poses[b].x() - poses[a].x()) +
                                         std::sin(poses[i].z()) * (poses[b].y() - poses[a].y()) <
                                     0.0
                                 ? -1.0
                                 : 1.0;
    const double scale = direction / kKnot_s;
    const double speed = scale * (distance[b] - distance[a]) / 2.0;
    const double acceleration = scale / kKnot_s * ((distance[b] - distance[i]) - (distance[i] - distance[a]));
    const double yaw_rate = (poses[b].z() - poses[a].z()) / (2.0 * kKnot_s);
    PoseCoordinates x = coordinates(poses[i], acceleration, speed * yaw_rate, direction, c);
    const Eigen::Vector2d velocity = (poses[b] - poses[a]).head<2>() / (2.0 * kKnot_s);
    const BodyDisplacement ride = road.at(poses[i].head<2>(), x(3), velocity);
    x.tail<4>() += Eigen::Vector4d(ride.heave, 0.0, ride.pitch, ride.roll);
    samples.push_back(x);
  }
  return {-kLead * kKnot_s, kKnot_s, samples};
}

}  // namespace

std::vector<std::int64_t> sample_times(double rate_hz, double phase_s, double duration_s) {
  std::vector<std::int64_t> times;
  const auto end = static_cast<std::int64_t>(std::llround(duration_s * 1e6));
  for (std::int64_t i = 0;; ++i) {
    const auto t = static_cast<std::int64_t>(std::llround((phase_s + static_cast<double>(i) / rate_hz) * 1e6));
    if (t > end) return times;
    times.push_back(t);
  }
}

Kinematics SimulatedDrive::kinematics_at(std::int64_t t_us) const {
  return motion->at(seconds_between(config.start_utime, t_us));
}

Odometry SimulatedDrive::truth_at(std::int64_t t_us) const {
  const Kinematics k = kinematics_at(t_us);
  Odometry o;
  o.t_us = t_us;
  o.T_frame_vehicle = k.T_enu_vehicle;
  o.velocity = k.T_enu_vehicle.q.conjugate() * k.velocity_enu;
  o.angular_rate = k.angular_rate;
  o.validity = Validity::kValid;
  return o;
}

SimulatedDrive simulate(const ScenarioConfig& config, std::uint64_t seed) {
  SimulatedDrive drive;
  drive.config = config;
  drive.seed = seed;
  drive.anchor = EnuAnchor({config.anchor_lat_deg * kDegree, config.anchor_lon_deg * kDegree, config.anchor_height_m});
  drive.motion = std::make_shared<const Motion>(drive_route(drive));
  simulate_imu(drive);
  simulate_gnss(drive);
  simulate_wheels(drive);
  simulate_mag(drive);
  simulate_camera(drive);
  for (const std::int64_t t_us : sample_times(config.truth_rate_hz, 0.0, config.duration_s)) {
    drive.truth.push_back(drive.truth_at(config.start_utime + t_us));
  }
  return drive;
}

}  // namespace roadfix
