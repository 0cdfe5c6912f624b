#include "slam/levelling.h"

#include "geometry/so3.h"

namespace roadfix {

Eigen::Quaterniond levelling_rotation(const Eigen::Quaterniond& q_map_vehicle,
                                      const Eigen::Quaterniond& q_level_vehicle) {
  const Eigen::Vector3d up_in_map = q_map_vehicle * (q_level_vehicle.conjugate() * Eigen::Vector3d::UnitZ());
  return Eigen::Quaterniond::FromTwoVectors(up_in_map, Eigen::Vector3d::UnitZ()).normalized();
}

Matrix6d LevellingRotation::covariance(const Matrix6d& before, const SE3& T_map_camera) const {
  Matrix6d F = Matrix6d::Identity();
  F.topLeftCorner<3, 3>() = q.toRotationMatrix();
  Eigen::Matrix<double, 6, 2> J;  // of the pose by the errors of the two horizontal axes
  J.topRows<3>() = -skew(T_map_camera.p - pivot).leftCols<2>();
  J.bottomRows<3>() = T_map_camera.R().transpose().leftCols<2>();
  return F * before * F.transpose() + sigma * sigma * J * J.transpose();
}

}  // namespace roadfix
