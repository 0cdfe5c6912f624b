#include "slam/pose_covariance.h"

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

Matrix6d rotated(const Matrix6d& cov, const Sim3& S) {
  Matrix6d F = Matrix6d::Identity();
  F.topLeftCorner<3, 3>() = S.scale * S.q.toRotationMatrix();
  return F * cov * F.transpose();
}

}  // namespace roadfix
