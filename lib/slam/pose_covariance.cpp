#include "slam/pose_covariance.h"

#include "geometry/so3.h"

namespace roadfix {

Matrix6d vehicle_covariance(const Matrix6d& cov_camera, const SE3& T_map_camera, const SE3& T_camera_vehicle) {
  Matrix6d F = Matrix6d::Identity();
  F.topRightCorner<3, 3>() = -T_map_camera.R() * skew(T_camera_vehicle.p);
  F.bottomRightCorner<3, 3>() = T_camera_vehicle.R().transpose();
  return F * cov_camera * F.transpose();
}

Matrix6d carried(const Matrix6d& cov, const SE3& T_map_before, const SE3& T_before_now) {
  Matrix6d F = Matrix6d::Identity();
  F.topRightCorner<3, 3>() = -T_map_before.R() * skew(T_before_now.p);
  F.bottomRightCorner<3, 3>() = T_before_now.R().transpose();
  return F * cov * F.transpose();
}

Matrix6d in_map(const Matrix6d& cov, const Sim3& S) {
  Matrix6d F = Matrix6d::Identity();
  F.topLeftCorner<3, 3>() = S.scale * S.q.toRotationMatrix();
  return F * cov * F.transpose();
}

}  // namespace roadfix
