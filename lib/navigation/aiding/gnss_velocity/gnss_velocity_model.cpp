#include "navigation/aiding/gnss_velocity/gnss_velocity_model.h"

#include "geometry/so3.h"

namespace roadfix::navigation {

Measurement<3> gnss_velocity(const State& state, const BodyMotion& motion, const Eigen::Vector3d& z,
                             const Eigen::Matrix3d& cov, double ahead) {
  const Mean& x = state.x;
  const Eigen::Matrix3d R = x.R();
  const Eigen::Vector3d velocity = x.nav.velocity + R * motion.rate.cross(x.p_imu_antenna);
  Measurement<3> m;
  m.residual = z - (velocity + ahead * motion.acceleration + x.gnss_velocity_bias);
  m.H.block<3, 3>(0, kVel).setIdentity();
  m.H.block<3, 3>(0, kAtt) = -skew(velocity);
  m.H.block<3, 3>(0, kGyroBias) = R * skew(x.p_imu_antenna);
  m.H.block<3, 3>(0, kAntenna) = R * skew(motion.rate);
  m.H.col(kVelocityLatency) = -motion.acceleration;
  m.H.col(kImuOffset) = motion.acceleration;
  m.H.block<3, 3>(0, kGnssVelocityBias).setIdentity();
  m.R = cov;
  return m;
}

}  // namespace roadfix::navigation
