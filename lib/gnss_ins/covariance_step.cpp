#include "gnss_ins/covariance_step.h"

#include <cmath>

#include "geometry/so3.h"

namespace roadfix {

void TransitionSums::add(const Eigen::Matrix3d& R, const InertialStep& step, double gyro_density,
                         double accel_density) {
  const double dt = step.dt;
  const Eigen::Vector3d dv = R * step.specific_force * dt;
  const Eigen::Matrix3d R_force = R * step.specific_force.asDiagonal();
  position_change += dt * (velocity_change + 0.5 * dv);
  velocity_change += dv;
  rotation2 += dt * (rotation + (0.5 * dt) * R);
  rotation += dt * R;
  rotation_force2 += dt * (rotation_force + (0.5 * dt) * R_force);
  rotation_force += dt * R_force;
  rotation_rate += R * (dt * step.rate).asDiagonal();
  gyro_variance += gyro_density * gyro_density * dt;
  accel_variance += accel_density * accel_density * dt;
  duration += dt;
}

Transition::Transition(const TransitionSums& s, const Eigen::Vector3d& earth_rate, const GnssInsConfig& config)
    : duration(s.duration) {
  const Eigen::Matrix3d turn = skew(earth_rate * s.duration);
  const Eigen::Matrix3d dv_cross = skew(s.velocity_change);
  const Eigen::Matrix3d dp_cross = skew(s.position_change);
  vel_vel = Eigen::Matrix3d::Identity() - 2.0 * turn;
  pos_vel = s.duration * (Eigen::Matrix3d::Identity() - turn);
  att_att = Eigen::Matrix3d::Identity() - turn;
  vel_att = -dv_cross;
  pos_att = -dp_cross;
  // A gyro error turns the attitude in proportion to time, and that turns the specific force: half of the product for
  // the velocity, a third for the position, exact for constant motion within the step.
  att_imu << -s.rotation, Eigen::Matrix3d::Zero(), -s.rotation_rate, Eigen::Matrix3d::Zero();
  vel_imu << 0.5 * dv_cross * s.rotation, -s.rotation, 0.5 * dv_cross * s.rotation_rate, -s.rotation_force;
  pos_imu << dp_cross * s.rotation / 3.0, -s.rotation2, dp_cross * s.rotation_rate / 3.0, -s.rotation_force2;

  decay.setOnes();
  noise.setZero();
  const GnssInsVehicle& v = config.vehicle;
  const PropagationConfig& p = config.propagation;
  const double fade = std::exp(-s.duration / v.correlation_s);  // first-order Gauss-Markov, (M.14)
  decay.segment<12>(kGyroBias).setConstant(fade);
  const double gain = 1.0 - fade * fade;
  noise.segment<3>(kGyroBias).setConstant(gain * v.gyro_bias_std * v.gyro_bias_std);
  noise.segment<3>(kAccelBias).setConstant(gain * v.accel_bias_std * v.accel_bias_std);
  noise.segment<6>(kGyroScale).setConstant(gain * v.scale_std * v.scale_std);
  noise(kWheelScale) = p.wheel_scale_walk * p.wheel_scale_walk * s.duration;
  noise.segment<2>(kMounting).setConstant(p.mounting_walk * p.mounting_walk * s.duration);
  // The IMU's clock drifts against the receiver's; where the IMU defines time, the fixes do.
  const TimePriors time(v);
  const double walk = p.time_offset_walk * p.time_offset_walk * s.duration;
  if (time.imu_offset > 0.0) noise(kImuOffset) = walk;
  if (time.position_latency > 0.0 && v.time_offset_std > 0.0) noise(kPositionLatency) = walk;
}

ErrorMatrix Transition::dense() const {
  ErrorMatrix phi = decay.asDiagonal();
  phi.block<3, 3>(kPos, kVel) = pos_vel;
  phi.block<3, 3>(kVel, kVel) = vel_vel;
  phi.block<3, 3>(kAtt, kAtt) = att_att;
  phi.block<3, 3>(kPos, kAtt) = pos_att;
  phi.block<3, 3>(kVel, kAtt) = vel_att;
  phi.block<3, 12>(kPos, kGyroBias) = pos_imu;
  phi.block<3, 12>(kVel, kGyroBias) = vel_imu;
  phi.block<3, 12>(kAtt, kGyroBias) = att_imu;
  return phi;
}

namespace {

// The nine moved rows of Phi P, for the columns of P.
using NineRows = Eigen::Matrix<double, 9, kStates>;

NineRows moved_rows(const ErrorMatrix& P, const Transition& phi) {
  NineRows rows;
  rows.middleRows<3>(kPos) = P.middleRows<3>(kPos);
  rows.middleRows<3>(kPos).noalias() += phi.pos_vel.lazyProduct(P.middleRows<3>(kVel));
  rows.middleRows<3>(kPos).noalias() += phi.pos_att.lazyProduct(P.middleRows<3>(kAtt));
  rows.middleRows<3>(kPos).noalias() += phi.pos_imu.lazyProduct(P.middleRows<12>(kGyroBias));
  rows.middleRows<3>(kVel).noalias() = phi.vel_vel.lazyProduct(P.middleRows<3>(kVel));
  rows.middleRows<3>(kVel).noalias() += phi.vel_att.lazyProduct(P.middleRows<3>(kAtt));
  rows.middleRows<3>(kVel).noalias() += phi.vel_imu.lazyProduct(P.middleRows<12>(kGyroBias));
  rows.middleRows<3>(kAtt).noalias() = phi.att_att.lazyProduct(P.middleRows<3>(kAtt));
  rows.middleRows<3>(kAtt).noalias() += phi.att_imu.lazyProduct(P.middleRows<12>(kGyroBias));
  return rows;
}

}  // namespace

void propagate_covariance(ErrorMatrix& P, const Transition& phi, const TransitionSums& sums) {
  const NineRows rows = moved_rows(P, phi);
  // Columns of the moved block: (Phi P) Phi', from the same products on the transpose.
  Eigen::Matrix<double, 9, 9> A;
  A.middleCols<3>(kPos).noalias() = rows.middleCols<3>(kPos);
  A.middleCols<3>(kPos).noalias() += rows.middleCols<3>(kVel).lazyProduct(phi.pos_vel.transpose());
  A.middleCols<3>(kPos).noalias() += rows.middleCols<3>(kAtt).lazyProduct(phi.pos_att.transpose());
  A.middleCols<3>(kPos).noalias() += rows.middleCols<12>(kGyroBias).lazyProduct(phi.pos_imu.transpose());
  A.middleCols<3>(kVel).noalias() = rows.middleCols<3>(kVel).lazyProduct(phi.vel_vel.transpose());
  A.middleCols<3>(kVel).noalias() += rows.middleCols<3>(kAtt).lazyProduct(phi.vel_att.transpose());
  A.middleCols<3>(kVel).noalias() += rows.middleCols<12>(kGyroBias).lazyProduct(phi.vel_imu.transpose());
  A.middleCols<3>(kAtt).noalias() = rows.middleCols<3>(kAtt).lazyProduct(phi.att_att.transpose());
  A.middleCols<3>(kAtt).noalias() += rows.middleCols<12>(kGyroBias).lazyProduct(phi.att_imu.transpose());

  constexpr int kRest = kStates - 9;
  P.topLeftCorner<9, 9>() = 0.5 * (A + A.transpose());
  P.topRightCorner<9, kRest>() = rows.rightCols<kRest>() * phi.decay.tail<kRest>().asDiagonal();
  P.bottomLeftCorner<kRest, 9>() = P.topRightCorner<9, kRest>().transpose();
  // Products of the two factors commute, so the block stays symmetric to the last bit.
  const Eigen::Matrix<double, kRest, kRest> factors = phi.decay.tail<kRest>() * phi.decay.tail<kRest>().transpose();
  P.bottomRightCorner<kRest, kRest>().array() *= factors.array();
  P.diagonal() += phi.noise;

  // White noise of the sensors over the step, (M.15); its share in the position is below a micrometre at 20 Hz but
  // keeps the block positive definite.
  const double T = sums.duration;
  for (int i = 0; i < 3; ++i) {
    P(kAtt + i, kAtt + i) += sums.gyro_variance;
    P(kVel + i, kVel + i) += sums.accel_variance;
    P(kPos + i, kPos + i) += sums.accel_variance * T * T / 3.0;
    P(kPos + i, kVel + i) += sums.accel_variance * T / 2.0;
    P(kVel + i, kPos + i) += sums.accel_variance * T / 2.0;
  }
}

}  // namespace roadfix
