#include "navigation/aiding/gnss_position/gnss_position_model.h"

#include "geometry/so3.h"

namespace roadfix::navigation {

Measurement<3> gnss_position(const State& state, const BodyMotion& motion, const Eigen::Vector3d& z,
                             const Eigen::Matrix3d& cov, double ahead) {
  const Mean& x = state.x;
  const Eigen::Matrix3d R = x.R();
  const Eigen::Vector3d arm = R * x.p_imu_antenna;
  const Eigen::Vector3d turning = R * motion.rate.cross(x.p_imu_antenna);
  const Eigen::Vector3d velocity = x.nav.velocity + turning;  // of the antenna
  Measurement<3> m;
  const Eigen::Vector3d h =
      x.nav.position + arm + ahead * velocity + 0.5 * ahead * ahead * motion.acceleration + x.gnss_bias + x.gnss_return;
  m.residual = z - h;
  m.H.block<3, 3>(0, kPos).setIdentity();
  m.H.block<3, 3>(0, kVel) = ahead * Eigen::Matrix3d::Identity();
  m.H.block<3, 3>(0, kAtt) = -skew(x.nav.position - state.p_ref + arm + ahead * velocity);
  m.H.block<3, 3>(0, kGyroBias) = ahead * R * skew(x.p_imu_antenna);
  m.H.block<3, 3>(0, kAntenna) = R * (Eigen::Matrix3d::Identity() + ahead * skew(motion.rate));
  const Eigen::Vector3d moved = velocity + ahead * motion.acceleration;
  m.H.col(kPositionLatency) = -moved;
  m.H.col(kImuOffset) = moved;
  m.H.block<3, 3>(0, kGnssBias).setIdentity();
  m.H.block<3, 3>(0, kGnssReturn).setIdentity();
  m.R = cov;
  return m;
}

}  // namespace roadfix::navigation
