/// The two motion models of Lee et al. (2025), constant acceleration (CA) and constant turn (CT); MODEL.md, section 3.
///
/// Both let the speed change with the acceleration; they differ in the turn: CA drives straight on and draws a small
/// yaw rate anew at each step, CT keeps its yaw rate and lets it wander.
#pragma once

#include "fusion/fusion_state.h"

namespace roadfix {

enum class MotionKind { kConstantAcceleration, kConstantTurn };

struct MotionNoise {
  double jerk = 2.0;            ///< m/s3 per sqrt(Hz): acceleration as a random walk
  double straight_turn = 0.03;  ///< rad/s, yaw rate of a car that drives straight, each step anew
  double turn_change = 0.14;    ///< rad/s, change of a turning car's yaw rate per step
  double slip = 0.03;           ///< m/s, sideways, of a car that drives straight
  double slip_arm = 1.5;        ///< m: sideways speed per yaw rate, of an origin that is not at the rear axle
  double slip_time = 1.0;       ///< s, for which a slip lasts
  double scale_walk = 2e-5;     ///< per sqrt(s), of the odometries' scales
};

/// Mean after dt; clones and parameters stay.
fusion::Vector moved(const fusion::Vector& x, MotionKind kind, double dt);

/// d moved / d x of the base states, (F.4).
using BaseMatrix = Eigen::Matrix<double, fusion::kBase, fusion::kBase>;
BaseMatrix moved_jacobian(const fusion::Vector& x, MotionKind kind, double dt);

/// The pose before a move, as a clone would have kept it.
struct PoseBefore {
  Eigen::Vector3d pose = Eigen::Vector3d::Zero();
  Eigen::Vector2d heading = Eigen::Vector2d::UnitX();  ///< cosine and sine of its yaw
  Eigen::Matrix3d P = Eigen::Matrix3d::Zero();
  Eigen::Matrix<double, fusion::kSize, 3> with = Eigen::Matrix<double, fusion::kSize, 3>::Zero();  ///< cov(state, it)
};

/// Mean and covariance after dt, (F.5). `before`: what a clone of the pose would have been after it.
void move(FusionEstimate& e, MotionKind kind, const MotionNoise& noise, double dt, PoseBefore* before = nullptr);

template <class Visitor>
void visit(MotionNoise& c, Visitor& v) {
  v.number("jerk_mps3_per_rthz", c.jerk, 0.0, 100.0);
  v.number("straight_turn_radps", c.straight_turn, 1e-4, 1.0);
  v.number("turn_change_radps", c.turn_change, 1e-4, 10.0);
  v.number("slip_mps", c.slip, 0.0, 100.0);
  v.number("slip_arm_m", c.slip_arm, 0.0, 100.0);
  v.number("slip_time_s", c.slip_time, 0.0, 100.0);
  v.number("scale_walk_per_rts", c.scale_walk, 0.0, 0.1);
}

}  // namespace roadfix
