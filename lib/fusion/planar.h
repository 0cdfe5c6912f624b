/// Poses seen from above: east, north, yaw, and how they move (MODEL.md, section 4).
#pragma once

#include <Eigen/Dense>

#include "samples/samples.h"

namespace roadfix {

/// x, y (m), yaw (rad) in some level frame.
using Planar = Eigen::Vector3d;

Planar planar_pose(const Odometry& odometry);
/// Its covariance from the 6x6 pose covariance: yaw's error is that of the rotation about the level frame's z.
Eigen::Matrix3d planar_covariance(const Odometry& odometry);

/// Of the velocity, in the axes of the level frame.
Eigen::Matrix2d horizontal_velocity_covariance(const Odometry& odometry);

/// All of a pose that the plane needs, worked out once.
struct LevelView {
  int64_t t_us = 0;
  Planar pose = Planar::Zero();
  Eigen::Matrix3d P = Eigen::Matrix3d::Zero();
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< m/s, in level axes, x along the yaw
  double turn = 0.0;                                   ///< rad/s, yaw rate of the level axes
};
LevelView level_view(const Odometry& odometry);

/// The same pose in another frame.
Odometry in_other_frame(const SE3& T_other_frame, const Odometry& odometry);

/// a - b with the yaw the short way round.
Planar difference_of(const Planar& a, const Planar& b);

/// Motion from a to b in a's axes: forward, left, turn.
Planar motion_between(const Planar& a, const Planar& b);
/// The pose reached from a by a motion in a's axes.
Planar after_motion(const Planar& a, const Planar& motion);

/// d motion_between / d a and / d b.
Eigen::Matrix3d motion_by_start(const Planar& a, const Planar& b);
Eigen::Matrix3d motion_by_end(const Planar& a);

/// d after_motion / d a.
Eigen::Matrix3d after_motion_by_start(const Planar& a, const Planar& motion);

/// after_motion and its Jacobians, the yaw's sine and cosine worked out once.
struct MovedPlanar {
  Planar pose;
  Eigen::Matrix3d by_start, by_motion;
};
MovedPlanar moved_by(const Planar& a, const Planar& motion);

/// T P T' of a pose's covariance: as a frame sees it in which the first one is turned by an angle of cosine c, sine s.
Eigen::Matrix3d turned(const Eigen::Matrix3d& P, double c, double s);

/// Covariance of the motion between two poses of one estimator, in the axes of a, if its errors were a sum of
/// independent steps: what the second covariance has more than the first carried along (F.12). Directions in which it
/// shrank, because the estimator learnt something, get the floor.
Eigen::Matrix3d motion_covariance(const Planar& a, const Eigen::Matrix3d& P_a, const Planar& motion,
                                  const Eigen::Matrix3d& P_b, const Eigen::Vector3d& floor_sigma);

struct PlanarEstimate {
  Planar pose = Planar::Zero();
  Eigen::Matrix3d P = Eigen::Matrix3d::Zero();
};
/// `other`, a pose of the same vehicle in another frame, after the motion that took `start` to a covariance P_end;
/// along and across the way and in yaw it loses `least` (m2, rad2) at least.
PlanarEstimate moved_along(const PlanarEstimate& other, const PlanarEstimate& start, const Planar& motion,
                           const Eigen::Matrix3d& P_end, const Eigen::Vector3d& least);

/// What a pose that is led by velocities and a gyro has in common with their errors, along, across and in yaw, which
/// last until the estimator learns (F.16).
class LastingVelocity {
 public:
  /// m2, rad2 that the next dt seconds add along, across and in yaw, if the variances are those of the last carry().
  [[nodiscard]] Eigen::Vector3d grown(double yaw, double dt) const;
  /// The next dt seconds, at whose end velocity and yaw rate have these variances (m2/s2, rad2/s2).
  void carry(double yaw, double dt, const Eigen::Vector3d& variances);

  template <class Self, class Visitor>
  static void visit_members(Self& self, const Visitor& visit) {
    visit(self.common_, self.variances_);
  }

 private:
  Eigen::Matrix3d common_ = Eigen::Matrix3d::Zero();  ///< pose in its frame, velocities in the vehicle's
  Eigen::Vector3d variances_ = Eigen::Vector3d::Zero();
};

/// What all lengths and turns of a vision's way have wrong alike, by its calibration.
struct CommonError {
  Eigen::Matrix<double, 6, 2> columns = Eigen::Matrix<double, 6, 2>::Zero();  ///< of its pose, per sigma
  double scale_std = 0.0;                                                     ///< of its velocity, relative
  bool turns_exact = false;  ///< its turns share nothing: so two eyes say whose focal length is exact
};
/// The pose with covariances that do not hold that any more: it is one scale and one drift here, not new in each step.
/// At most as much of it is taken out as there is.
Odometry without_common(Odometry o, const CommonError& common);

/// What a vision's pose has wrong that does not add up along its way: order and axes of a pose covariance.
struct PassingError {
  Matrix6d picture = Matrix6d::Zero();  ///< this picture's alone; contained in the pose's covariance
  Matrix6d map = Matrix6d::Zero();      ///< of the local map that it is seen against,
  double map_time = 0.0;                ///< s, which that map spans: then it is another one
};
/// Likewise, without the picture's part: a motion's covariance is what the rest grows by.
Odometry without_picture(Odometry o, const PassingError& passing);

/// The same from above, in the vehicle's level axes.
struct PlanarPassing {
  Eigen::Matrix3d picture = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d map = Eigen::Matrix3d::Zero();
  double map_time = 0.0;
};
PlanarPassing planar_passing(const Odometry& o, const PassingError& passing);
/// An error that is new in each picture and tells as little in the long run, with pictures dt apart (F.11e).
Eigen::Matrix3d as_white(const PlanarPassing& passing, double dt);

/// Least variance that a height gains on a way, m2.
double height_growth(double way, double dt);

/// Motion from a to b by the mean of the velocities, and the rise: for a step in which the estimator corrected itself.
struct FeltMotion {
  Planar way = Planar::Zero();
  double rise = 0.0;  ///< m
};
FeltMotion motion_by_velocity(const LevelView& a, const LevelView& b);

}  // namespace roadfix
