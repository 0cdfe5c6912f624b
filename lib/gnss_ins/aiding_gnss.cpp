#include "geometry/so3.h"
#include "gnss_ins/aiding.h"

namespace roadfix {

namespace {

// Velocity of the antenna over the earth and its parts, (M.21).
struct AntennaMotion {
  Eigen::Matrix3d R;
  Eigen::Vector3d turning;   // R (rate x lever)
  Eigen::Vector3d velocity;  // v + turning
  AntennaMotion(const NavState& x, const BodyMotion& m)
      : R(x.q_enu_imu.toRotationMatrix()), turning(R * m.rate.cross(x.p_imu_antenna)), velocity(x.velocity + turning) {}
};

}  // namespace

Measurement<3> gnss_position(const NavState& x, const BodyMotion& motion, const Eigen::Vector3d& z,
                             const Eigen::Matrix3d& cov, double ahead) {
  const AntennaMotion antenna(x, motion);
  const Eigen::Vector3d arm = antenna.R * x.p_imu_antenna;
  Measurement<3> m;
  m.residual = z - (x.position + arm + ahead * antenna.velocity + 0.5 * ahead * ahead * motion.acceleration);
  m.H.block<3, 3>(0, kPos).setIdentity();
  m.H.block<3, 3>(0, kVel) = ahead * Eigen::Matrix3d::Identity();
  m.H.block<3, 3>(0, kAtt) = -skew(arm + ahead * antenna.turning);
  m.H.block<3, 3>(0, kGyroBias) = ahead * antenna.R * skew(x.p_imu_antenna);
  m.H.block<3, 3>(0, kAntenna) = antenna.R * (Eigen::Matrix3d::Identity() + ahead * skew(motion.rate));
  const Eigen::Vector3d moved = antenna.velocity + ahead * motion.acceleration;
  m.H.col(kPositionLatency) = -moved;
  m.H.col(kImuOffset) = moved;
  m.R = cov;
  return m;
}

Measurement<3> gnss_velocity(const NavState& x, const BodyMotion& motion, const Eigen::Vector3d& z,
                             const Eigen::Matrix3d& cov, double ahead) {
  const AntennaMotion antenna(x, motion);
  Measurement<3> m;
  m.residual = z - (antenna.velocity + ahead * motion.acceleration);
  m.H.block<3, 3>(0, kVel).setIdentity();
  m.H.block<3, 3>(0, kAtt) = -skew(antenna.turning);
  m.H.block<3, 3>(0, kGyroBias) = antenna.R * skew(x.p_imu_antenna);
  m.H.block<3, 3>(0, kAntenna) = antenna.R * skew(motion.rate);
  m.H.col(kVelocityLatency) = -motion.acceleration;
  m.H.col(kImuOffset) = motion.acceleration;
  m.R = cov;
  return m;
}

}  // namespace roadfix
