/// Poses seen from above: x, y, yaw in a level frame, and how they move (MODEL.md, section 3).
#pragma once

#include <Eigen/Dense>

#include "samples/samples.h"

namespace roadfix {

/// x, y (m), yaw (rad) in some level frame.
using Planar = Eigen::Vector3d;

Planar planar_pose(const Odometry& odometry);
/// Its covariance from the 6x6 pose covariance: yaw's error is that of the rotation about the level frame's z.
Eigen::Matrix3d planar_covariance(const Odometry& odometry);

/// All of a pose that the plane needs, worked out once.
struct LevelView {
  int64_t t_us = 0;
  Planar pose = Planar::Zero();
  Eigen::Matrix3d P = Eigen::Matrix3d::Zero();
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< m/s, in level axes, x along the yaw
  double turn = 0.0;                                   ///< rad/s, yaw rate of the level axes
  template <class Self, class Visitor>
  static void visit_members(Self& self, const Visitor& visit) {
    visit(self.t_us, self.pose, self.P, self.velocity, self.turn);
  }
};
LevelView level_view(const Odometry& odometry);

/// The same pose in another frame.
Odometry in_other_frame(const SE3& T_other_frame, const Odometry& odometry);

/// A full pose from a planar one and a height; roll, pitch and velocity are those of `attitude`.
Odometry full_pose(int64_t t_us, const Planar& pose, const Eigen::Matrix3d& P, double height, double height_variance,
                   const Odometry& attitude);

/// a - b with the yaw the short way round.
Planar difference_of(const Planar& a, const Planar& b);

/// Motion from a to b in a's axes: forward, left, turn.
Planar motion_between(const Planar& a, const Planar& b);
/// The pose reached from a by a motion in a's axes.
Planar after_motion(const Planar& a, const Planar& motion);

/// after_motion and its Jacobians, the yaw's sine and cosine worked out once.
struct MovedPlanar {
  Planar pose;
  Eigen::Matrix3d by_start, by_motion;
};
MovedPlanar moved_by(const Planar& a, const Planar& motion);
/// Covariance of the pose reached: P of the start, R of the motion.
Eigen::Matrix3d moved_covariance(const MovedPlanar& moved, const Eigen::Matrix3d& P, const Eigen::Matrix3d& R);

/// T P T' of a pose's covariance: as a frame sees it in which the first one is turned by an angle of cosine c, sine s.
Eigen::Matrix3d turned(const Eigen::Matrix3d& P, double c, double s);

/// Motion and rise by the mean of the velocities of two samples: without the corrections of a filter's pose.
struct VelocityMotion {
  Planar way = Planar::Zero();
  double rise = 0.0;  ///< m
};
VelocityMotion motion_by_velocity(const LevelView& a, const LevelView& b);
/// The same from one sample on, for `dt` seconds with its velocity and turn.
Planar motion_ahead(const LevelView& a, double dt);

}  // namespace roadfix
