#include "geometry/so3.h"
#include "gnss_ins/aiding.h"

namespace roadfix {

Measurement<3> zero_velocity(const NavState& x, double sigma) {
  Measurement<3> m;
  m.residual = -x.velocity;
  m.H.block<3, 3>(0, kVel).setIdentity();
  m.R = sigma * sigma * Eigen::Matrix3d::Identity();
  return m;
}

Measurement<3> zero_rate(const NavState& x, const Eigen::Vector3d& mean_gyro, const Eigen::Vector3d& earth_rate_enu,
                         double sigma) {
  const Eigen::Matrix3d R = x.q_enu_imu.toRotationMatrix();
  Measurement<3> m;
  m.residual = mean_gyro - (x.gyro_bias + R.transpose() * earth_rate_enu);
  m.H.block<3, 3>(0, kAtt) = R.transpose() * skew(earth_rate_enu);
  m.H.block<3, 3>(0, kGyroBias).setIdentity();
  m.R = sigma * sigma * Eigen::Matrix3d::Identity();
  return m;
}

Measurement<3> levelling(const NavState& x, const Eigen::Vector3d& mean_accel, const Eigen::Vector3d& gravity_enu,
                         double sigma) {
  const Eigen::Matrix3d R = x.q_enu_imu.toRotationMatrix();
  Measurement<3> m;
  m.residual = mean_accel - (x.accel_bias - R.transpose() * gravity_enu);
  m.H.block<3, 3>(0, kAtt) = -R.transpose() * skew(gravity_enu);
  m.H.block<3, 3>(0, kAccelBias).setIdentity();
  m.R = sigma * sigma * Eigen::Matrix3d::Identity();
  return m;
}

}  // namespace roadfix
