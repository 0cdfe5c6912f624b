#include "slam/standstill_constraint.h"

#include "geometry/so3.h"

namespace roadfix {

StandstillConstraint standstill_constraint(const SE3& T_map_earlier, const SE3& T_map_later,
                                           const StandstillSigma& sigma) {
  const Eigen::Vector3d turn = log_q(T_map_earlier.q.conjugate() * T_map_later.q);
  StandstillConstraint constraint;
  constraint.residual << (T_map_earlier.p - T_map_later.p) / sigma.position, -turn / sigma.rotation;
  constraint.J_later.topLeftCorner<3, 3>() = Eigen::Matrix3d::Identity() / sigma.position;
  constraint.J_later.bottomRightCorner<3, 3>() = right_jacobian_inverse(turn) / sigma.rotation;
  constraint.J_earlier.topLeftCorner<3, 3>() = -Eigen::Matrix3d::Identity() / sigma.position;
  constraint.J_earlier.bottomRightCorner<3, 3>() = -right_jacobian_inverse(-turn) / sigma.rotation;
  return constraint;
}

}  // namespace roadfix
