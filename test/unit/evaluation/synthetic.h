/// Analytic drives for the tests of the evaluation, and readers of the pose files in ../shared/data/trajectories.
#pragma once

#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "evaluation/trajectory.h"
#include "geometry/so3.h"

namespace roadfix::test {

/// A drive on a figure of eight, 10 m/s or less, yaw along the course, with a little height; exact velocity and rate.
inline Odometry eight(double t_s) {
  constexpr double kSize = 200.0;
  constexpr double kOmega = 0.05;
  const double a = kOmega * t_s;
  Odometry pose;
  pose.t_us = static_cast<int64_t>(std::llround(t_s * 1e6));
  pose.T_frame_vehicle.p = {kSize * std::sin(a), 0.5 * kSize * std::sin(2 * a), 3.0 * std::cos(a)};
  const Eigen::Vector3d v(kSize * kOmega * std::cos(a), kSize * kOmega * std::cos(2 * a), -3.0 * kOmega * std::sin(a));
  const Eigen::Vector2d acceleration(-kSize * kOmega * kOmega * std::sin(a),
                                     -2 * kSize * kOmega * kOmega * std::sin(2 * a));
  const double yaw = std::atan2(v.y(), v.x());
  pose.T_frame_vehicle.q = exp_q(Eigen::Vector3d(0, 0, yaw));
  pose.velocity = pose.T_frame_vehicle.q.conjugate() * v;
  pose.angular_rate.z() = (v.x() * acceleration.y() - v.y() * acceleration.x()) / v.head<2>().squaredNorm();
  pose.validity = Validity::kValid;
  return pose;
}

inline Trajectory eight_trajectory(double begin_s, double end_s, double dt_s) {
  Trajectory trajectory;
  const auto count = static_cast<int>(std::lround((end_s - begin_s) / dt_s));
  for (int i = 0; i <= count; ++i) trajectory.poses.push_back(eight(begin_s + i * dt_s));
  return trajectory;
}

/// The trajectory with each pose changed by f.
template <class Function>
Trajectory changed(Trajectory trajectory, const Function& f) {
  for (Odometry& pose : trajectory.poses) f(pose);
  return trajectory;
}

/// KITTI poses: 12 numbers a line, rows of [R t]; with `framed`, a frame number before them. `times` gives the time of
/// each frame.
inline Trajectory read_kitti(const std::filesystem::path& path, const std::vector<double>& times, bool framed,
                             bool invert = false) {
  std::ifstream in(path);
  Trajectory trajectory;
  trajectory.has_velocity = false;
  std::string line;
  for (std::size_t row = 0; std::getline(in, line); ++row) {
    std::istringstream fields(line);
    double number = 0.0;
    if (framed) fields >> number;
    const std::size_t frame = framed ? static_cast<std::size_t>(number) : row;
    Eigen::Matrix<double, 3, 4> M;
    for (int i = 0; i < 12; ++i) fields >> M(i / 4, i % 4);
    Odometry pose;
    pose.t_us = static_cast<int64_t>(std::llround(times.at(frame) * 1e6));
    pose.T_frame_vehicle = {Eigen::Quaterniond(Eigen::Matrix3d(M.leftCols<3>())).normalized(), M.col(3)};
    if (invert) pose.T_frame_vehicle = pose.T_frame_vehicle.inverse();
    pose.validity = Validity::kValid;
    trajectory.poses.push_back(pose);
  }
  return trajectory;
}

inline std::vector<double> read_times(const std::filesystem::path& path) {
  std::ifstream in(path);
  std::vector<double> times;
  for (double t = 0.0; in >> t;) times.push_back(t);
  return times;
}

}  // namespace roadfix::test
