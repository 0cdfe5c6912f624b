#include "geometry/se3.h"

#include "geometry/so3.h"

namespace roadfix {

SE3 SE3::inverse() const {
  const Eigen::Quaterniond q_inverse = q.conjugate();
  return {q_inverse, -(q_inverse * p)};
}

SE3 operator*(const SE3& T_a_b, const SE3& T_b_c) {
  return {(T_a_b.q * T_b_c.q).normalized(), T_a_b.p + T_a_b.q * T_b_c.p};
}

Eigen::Vector3d operator*(const SE3& T_a_b, const Eigen::Vector3d& p_b) { return T_a_b.p + T_a_b.q * p_b; }

SE3 retract(const SE3& T, const Vector6d& d) { return {(T.q * exp_q(d.tail<3>())).normalized(), T.p + d.head<3>()}; }

Vector6d local(const SE3& x, const SE3& y) {
  Vector6d d;
  d << y.p - x.p, log_q(x.q.conjugate() * y.q);
  return d;
}

}  // namespace roadfix
