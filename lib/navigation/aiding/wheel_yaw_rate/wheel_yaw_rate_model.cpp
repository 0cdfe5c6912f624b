#include "navigation/aiding/wheel_yaw_rate/wheel_yaw_rate_model.h"

#include "geometry/so3.h"
#include "vehicle/axle_velocity.h"

namespace roadfix::navigation {

Measurement<1> wheel_yaw_rate(const State& state, const Eigen::Vector3d& mean_gyro, double yaw_rate, double sigma) {
  const Mean& x = state.x;
  const Eigen::Matrix3d to_vehicle = vehicle::R_imu_vehicle(x.mounting).transpose();
  const Eigen::Vector3d rate = x.corrected(mean_gyro, Eigen::Vector3d::Zero(), 1.0).rate;
  const Eigen::Vector3d in_vehicle = to_vehicle * rate;
  const Eigen::Matrix3d J = right_jacobian(Eigen::Vector3d(0.0, x.mounting.x(), x.mounting.y()));
  Measurement<1> m;
  m.residual(0) = yaw_rate - in_vehicle.z();
  m.H.block<1, 3>(0, kGyroBias) = -to_vehicle.row(2).cwiseProduct((1.0 - x.gyro_scale.array()).matrix().transpose());
  m.H.block<1, 3>(0, kGyroScale) = -to_vehicle.row(2).cwiseProduct((mean_gyro - x.gyro_bias).transpose());
  m.H.block<1, 2>(0, kMounting) = (skew(in_vehicle) * J).row(2).tail<2>();
  m.R(0, 0) = sigma * sigma;
  return m;
}

}  // namespace roadfix::navigation
