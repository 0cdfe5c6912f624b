#include "navigation/aiding/zero_motion/zero_motion_model.h"

#include "geometry/so3.h"

namespace roadfix::navigation {

Measurement<3> zero_velocity(const State& state, double sigma) {
  const Eigen::Matrix3d to_imu = state.x.R().transpose();
  Measurement<3> m;
  m.residual = -to_imu * state.x.nav.velocity;
  m.H.block<3, 3>(0, kVel) = to_imu;
  m.R = sigma * sigma * Eigen::Matrix3d::Identity();
  return m;
}

Measurement<3> zero_rate(const State& state, const Eigen::Vector3d& mean_gyro, const Eigen::Vector3d& earth_rate,
                         double sigma) {
  const Eigen::Matrix3d to_imu = state.x.R().transpose();
  Measurement<3> m;
  m.residual = mean_gyro - (state.x.gyro_bias + to_imu * earth_rate);
  m.H.block<3, 3>(0, kAtt) = to_imu * skew(earth_rate);
  m.H.block<3, 3>(0, kGyroBias).setIdentity();
  m.R = sigma * sigma * Eigen::Matrix3d::Identity();
  return m;
}

Measurement<3> levelling(const State& state, const Eigen::Vector3d& mean_accel, const Eigen::Vector3d& gravity,
                         double sigma) {
  const Eigen::Matrix3d to_imu = state.x.R().transpose();
  Measurement<3> m;
  m.residual = mean_accel - (state.x.accel_bias - to_imu * gravity);
  m.H.block<3, 3>(0, kAtt) = -to_imu * skew(gravity);
  m.H.block<3, 3>(0, kAccelBias).setIdentity();
  m.R = sigma * sigma * Eigen::Matrix3d::Identity();
  return m;
}

}  // namespace roadfix::navigation
