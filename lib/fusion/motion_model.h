/// The two motion models of Lee et al. (2025), constant acceleration (CA) and constant turn (CT); MODEL.md, section 2.
///
/// Both let the speed change with the acceleration; they differ in the turn: CA drives straight on and draws a small
/// yaw rate anew at each step, CT keeps its yaw rate and lets it wander.
#pragma once

#include <Eigen/Dense>

namespace roadfix {
namespace fusion {

enum Index {
  kPos = 0,    ///< m, east and north, or x and y of a local frame
  kYaw = 2,    ///< rad, counterclockwise from the first axis
  kSpeed = 3,  ///< m/s, along the vehicle's x
  kAccel = 4,  ///< m/s2
  kTurn = 5,   ///< rad/s, yaw rate
  kSize = 6
};

using Vector = Eigen::Matrix<double, kSize, 1>;
using Matrix = Eigen::Matrix<double, kSize, kSize>;

}  // namespace fusion

/// Mean and covariance of one mode, or of all together. Angles are wrapped.
struct FusionEstimate {
  fusion::Vector x = fusion::Vector::Zero();
  fusion::Matrix P = fusion::Matrix::Zero();
  template <class Self, class Visitor>
  static void visit_members(Self& self, const Visitor& visit) {
    visit(self.x, self.P);
  }
};

/// a - b with the yaws the short way round.
fusion::Vector difference(const fusion::Vector& a, const fusion::Vector& b);
/// x + d with the yaw in (-pi, pi].
fusion::Vector plus(const fusion::Vector& x, const fusion::Vector& d);

enum class MotionKind { kConstantAcceleration, kConstantTurn };

struct MotionNoise {
  double jerk = 2.0;            ///< m/s3 per sqrt(Hz): acceleration as a random walk
  double straight_turn = 0.03;  ///< rad/s, yaw rate of a car that drives straight, each step anew
  double turn_change = 0.14;    ///< rad/s, change of a turning car's yaw rate per step
  double slip = 0.03;           ///< m/s, sideways, of a car that drives straight
  double slip_arm = 1.5;        ///< m: sideways speed per yaw rate, of an origin that is not at the rear axle
  double slip_time = 1.0;       ///< s, for which a slip lasts
};

template <class Visitor>
void visit(MotionNoise& c, Visitor& v) {
  v.number("jerk_mps3_per_rthz", c.jerk, 0.0, 100.0);
  v.number("straight_turn_radps", c.straight_turn, 1e-4, 1.0);
  v.number("turn_change_radps", c.turn_change, 1e-4, 10.0);
  v.number("slip_mps", c.slip, 0.0, 100.0);
  v.number("slip_arm_m", c.slip_arm, 0.0, 100.0);
  v.number("slip_time_s", c.slip_time, 0.0, 100.0);
}

/// Mean after dt, (F.2.1) to (F.2.3).
fusion::Vector moved(const fusion::Vector& x, MotionKind kind, double dt);

/// d moved / d x, (F.2.4).
fusion::Matrix moved_jacobian(const fusion::Vector& x, MotionKind kind, double dt);

/// Mean and covariance after dt, (F.2.5).
void move(FusionEstimate& e, MotionKind kind, const MotionNoise& noise, double dt);

}  // namespace roadfix
