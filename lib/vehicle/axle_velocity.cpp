#include "vehicle/axle_velocity.h"

#include "geometry/so3.h"

namespace roadfix::vehicle {

Eigen::Matrix3d R_imu_vehicle(const Eigen::Vector2d& mounting) {
  return exp_so3(Eigen::Vector3d(0.0, mounting.x(), mounting.y()));
}

AxleVelocity axle_velocity(const Eigen::Vector3d& velocity, const Eigen::Vector3d& rate,
                           const Eigen::Vector2d& mounting, const Eigen::Vector3d& p_imu_axle) {
  const Eigen::Matrix3d to_vehicle = R_imu_vehicle(mounting).transpose();
  AxleVelocity out;
  out.value = to_vehicle * (velocity + rate.cross(p_imu_axle));
  out.by_velocity = to_vehicle;
  out.by_rate = -to_vehicle * skew(p_imu_axle);
  const Eigen::Matrix3d J = right_jacobian(Eigen::Vector3d(0.0, mounting.x(), mounting.y()));
  out.by_mounting = (skew(out.value) * J).rightCols<2>();
  out.by_axle = to_vehicle * skew(rate);
  return out;
}

}  // namespace roadfix::vehicle
