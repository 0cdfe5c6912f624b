#include "slam/pose_covariance.h"

#include <cmath>

#include "geometry/so3.h"

namespace roadfix {

Matrix6d pose_transport_jacobian(const SE3& T_map_before, const SE3& T_before_now) {
  Matrix6d F = Matrix6d::Identity();
  F.topRightCorner<3, 3>() = -T_map_before.R() * skew(T_before_now.p);
  F.bottomRightCorner<3, 3>() = T_before_now.R().transpose();
  return F;
}

Matrix6d transported(const Matrix6d& cov, const SE3& T_map_before, const SE3& T_before_now) {
  const Matrix6d F = pose_transport_jacobian(T_map_before, T_before_now);
  return F * cov * F.transpose();
}

Matrix6d at_pose(const Matrix6d& cov, const SE3& T_map_a, const SE3& T_map_b) {
  return rotated(cov, {T_map_b.q * T_map_a.q.conjugate(), Eigen::Vector3d::Zero(), 1.0});
}

Matrix6d besides(const Matrix6d& whole, const Matrix6d& part, const SE3& T_map_body) {
  const Matrix6d whole_body = at_pose(whole, T_map_body, SE3()), part_body = at_pose(part, T_map_body, SE3());
  Vector6d left = Vector6d::Zero();
  for (int i = 0; i < 6; ++i)
    if (part_body(i, i) < whole_body(i, i)) left(i) = std::sqrt(1.0 - part_body(i, i) / whole_body(i, i));
  return at_pose(left.asDiagonal() * whole_body * left.asDiagonal(), SE3(), T_map_body);
}

Matrix6d rotated(const Matrix6d& cov, const Sim3& S) {
  Matrix6d F = Matrix6d::Identity();
  F.topLeftCorner<3, 3>() = S.scale * S.q.toRotationMatrix();
  return F * cov * F.transpose();
}

}  // namespace roadfix
