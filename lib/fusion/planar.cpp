#include "fusion/planar.h"

#include <algorithm>
#include <cmath>

#include "geometry/euler.h"
#include "geometry/so3.h"

namespace roadfix {
namespace {

constexpr double kGimbalLock = 1e-9;  ///< cosine of the pitch, as in euler.cpp

Eigen::Matrix2d rotation(double yaw) { return Eigen::Rotation2Dd(yaw).toRotationMatrix(); }

/// Rows of the rotation's errors about y and z in the yaw's error: (roll, pitch) alone decide.
Eigen::Matrix3d planar_covariance(const Matrix6d& C, double by_y, double by_z) {
  Eigen::Matrix3d P;
  P.topLeftCorner<2, 2>() = C.topLeftCorner<2, 2>();
  P.block<2, 1>(0, 2) = by_y * C.block<2, 1>(0, 4) + by_z * C.block<2, 1>(0, 5);
  P.block<1, 2>(2, 0) = P.block<2, 1>(0, 2).transpose();
  P(2, 2) = by_y * by_y * C(4, 4) + 2.0 * by_y * by_z * C(4, 5) + by_z * by_z * C(5, 5);
  return P;
}

/// Rates of (roll, pitch, yaw) by rotation in vehicle axes; its inverse carries angle errors to rotation errors.
Eigen::Matrix3d angles_by_rotation(const YawPitchRoll& a) {
  const double sr = std::sin(a.roll), cr = std::cos(a.roll), sp = std::sin(a.pitch), cp = std::cos(a.pitch);
  Eigen::Matrix3d E;
  E << 1.0, sr * sp / cp, cr * sp / cp, 0.0, cr, -sr, 0.0, sr / cp, cr / cp;
  return E;
}

}  // namespace

Planar planar_pose(const Odometry& o) {
  return {o.T_frame_vehicle.p.x(), o.T_frame_vehicle.p.y(), yaw_of(o.T_frame_vehicle.q)};
}

Eigen::Matrix3d planar_covariance(const Odometry& o) { return level_view(o).P; }

LevelView level_view(const Odometry& o) {
  const Eigen::Matrix3d R = o.T_frame_vehicle.R();
  // Sine and cosine of pitch and roll as yaw_pitch_roll() has them, without the angles.
  const double sp = -R(2, 0), cp = std::sqrt(R(0, 0) * R(0, 0) + R(1, 0) * R(1, 0));
  const bool level = cp > kGimbalLock;
  const double sr = level ? R(2, 1) / cp : 0.0, cr = level ? R(2, 2) / cp : 1.0;
  LevelView view;
  view.t_us = o.t_us;
  view.pose << o.T_frame_vehicle.p.x(), o.T_frame_vehicle.p.y(),
      level ? std::atan2(R(1, 0), R(0, 0)) : std::atan2(-R(0, 1), R(1, 1));
  view.P = planar_covariance(o.cov_pose, sr / cp, cr / cp);
  view.turn = (o.angular_rate.y() * sr + o.angular_rate.z() * cr) / cp;
  const double down = o.velocity.y() * sr + o.velocity.z() * cr;  // Ry(pitch) Rx(roll) v
  view.velocity << cp * o.velocity.x() + sp * down, cr * o.velocity.y() - sr * o.velocity.z(),
      cp * down - sp * o.velocity.x();
  return view;
}

Odometry in_other_frame(const SE3& T_other_frame, const Odometry& o) {
  Odometry moved = o;
  moved.T_frame_vehicle = T_other_frame * o.T_frame_vehicle;
  Matrix6d J = Matrix6d::Identity();
  J.topLeftCorner<3, 3>() = T_other_frame.R();
  moved.cov_pose = J * o.cov_pose * J.transpose();
  return moved;
}

Odometry full_pose(int64_t t_us, const Planar& pose, const Eigen::Matrix3d& P, double height, double height_variance,
                   const Odometry& attitude) {
  Odometry o = attitude;
  o.t_us = t_us;
  const YawPitchRoll a = yaw_pitch_roll(attitude.T_frame_vehicle.q);
  o.T_frame_vehicle.p << pose.x(), pose.y(), height;
  o.T_frame_vehicle.q = quaternion({pose.z(), a.pitch, a.roll});
  const Eigen::Matrix3d E = angles_by_rotation(a);
  const Eigen::Matrix3d to_rotation = E.inverse();
  const Eigen::Matrix3d angles = E * attitude.cov_pose.bottomRightCorner<3, 3>() * E.transpose();
  // Components: east, north, up, roll, pitch, yaw.
  Matrix6d C = Matrix6d::Zero();
  C.topLeftCorner<2, 2>() = P.topLeftCorner<2, 2>();
  C(2, 2) = height_variance;
  C.block<2, 2>(3, 3) = angles.topLeftCorner<2, 2>();
  C(5, 5) = P(2, 2);
  C.block<2, 1>(0, 5) = P.block<2, 1>(0, 2);
  C.block<1, 2>(5, 0) = P.block<1, 2>(2, 0);
  Matrix6d J = Matrix6d::Identity();
  J.bottomRightCorner<3, 3>() = to_rotation;
  o.cov_pose = J * C * J.transpose();
  return o;
}

Planar difference_of(const Planar& a, const Planar& b) {
  const Planar d = a - b;
  return {d.x(), d.y(), wrap_angle(d.z())};
}

Planar motion_between(const Planar& a, const Planar& b) {
  const Eigen::Vector2d d = rotation(-a.z()) * (b - a).head<2>();
  return {d.x(), d.y(), wrap_angle(b.z() - a.z())};
}

Planar after_motion(const Planar& a, const Planar& motion) { return moved_by(a, motion).pose; }

MovedPlanar moved_by(const Planar& a, const Planar& motion) {
  const Eigen::Matrix2d R = rotation(a.z());
  const Eigen::Vector2d d = R * motion.head<2>();
  MovedPlanar m{{a.x() + d.x(), a.y() + d.y(), wrap_angle(a.z() + motion.z())},
                Eigen::Matrix3d::Identity(),
                Eigen::Matrix3d::Identity()};
  m.by_start(0, 2) = -d.y();
  m.by_start(1, 2) = d.x();
  m.by_motion.topLeftCorner<2, 2>() = R;
  return m;
}

Eigen::Matrix3d moved_covariance(const MovedPlanar& m, const Eigen::Matrix3d& P, const Eigen::Matrix3d& R) {
  return m.by_start * P * m.by_start.transpose() + m.by_motion * R * m.by_motion.transpose();
}

Eigen::Matrix3d turned(const Eigen::Matrix3d& P, double c, double s) {
  const double cross = 0.5 * (P(0, 1) + P(1, 0));
  Eigen::Matrix3d C;
  C(0, 0) = c * c * P(0, 0) - 2.0 * c * s * cross + s * s * P(1, 1);
  C(1, 1) = s * s * P(0, 0) + 2.0 * c * s * cross + c * c * P(1, 1);
  C(0, 1) = C(1, 0) = c * s * (P(0, 0) - P(1, 1)) + (c * c - s * s) * cross;
  C(0, 2) = C(2, 0) = c * P(0, 2) - s * P(1, 2);
  C(1, 2) = C(2, 1) = s * P(0, 2) + c * P(1, 2);
  C(2, 2) = P(2, 2);
  return C;
}

VelocityMotion motion_by_velocity(const LevelView& a, const LevelView& b) {
  const double dt = seconds_between(a.t_us, b.t_us);
  // The turn is the attitudes' as far as it lies between the rates: these may be means over an interval, and the
  // trapezium's error adds up. Beyond, b's attitude has been corrected.
  const double middle = 0.5 * (a.turn + b.turn) * dt, slack = 0.5 * std::abs(b.turn - a.turn) * dt;
  const double turn = std::clamp(wrap_angle(b.pose.z() - a.pose.z()), middle - slack, middle + slack);
  const Eigen::Vector2d d = 0.5 * dt * (a.velocity.head<2>() + rotation(turn) * b.velocity.head<2>());
  return {{d.x(), d.y(), turn}, 0.5 * dt * (a.velocity.z() + b.velocity.z())};
}

Planar motion_ahead(const LevelView& a, double dt) {
  const double turn = a.turn * dt;
  const Eigen::Vector2d d = dt * (rotation(0.5 * turn) * a.velocity.head<2>());
  return {d.x(), d.y(), turn};
}

}  // namespace roadfix
