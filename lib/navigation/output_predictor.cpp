#include "navigation/output_predictor.h"

#include "geometry/so3.h"
#include "vehicle/axle_velocity.h"

namespace roadfix::navigation {

namespace {

constexpr double kCovarianceAge = 0.05;  // s that an output covariance may be used again

}  // namespace

void OutputPredictor::begin(const Filter& filter, const inertial::ImuRing& ring) {
  propagation_ = filter.propagation();
  x_ = filter.state().x;
  p_ref_ = filter.state().p_ref;
  P_ = filter.state().P().topLeftCorner<kWithoutCamera, kWithoutCamera>();
  next_ = ring.begin();
  begun_at_us_ = x_.t_us;
  begun_ = true;
  covariance_at_us_ = 0;
}

void OutputPredictor::find_covariance() {
  constexpr int kRows = 9, kOffset = kRows, kMount = kRows + 1, kInputs = kRows + 3;
  const BodyMotion& motion = propagation_.motion();
  // (phi, nu, rho) now, the clock offset and the mounting.
  Eigen::Matrix<double, kInputs, kInputs> P;
  Eigen::Matrix<double, kInertialSize, 3> beside;
  beside << P_.block<kInertialSize, 1>(0, kImuOffset), P_.block<kInertialSize, 2>(0, kMounting);
  if (propagation_.duration() > 0.0) {
    const inertial::ErrorTransition step =
        propagation_.transition(x_.nav, p_ref_, propagation_.earth().gravity(x_.nav.position));
    const Eigen::Matrix<double, kRows, kInertialSize> FP =
        step.F.lazyProduct(P_.topLeftCorner<kInertialSize, kInertialSize>());
    P.topLeftCorner<kRows, kRows>() = FP.lazyProduct(step.F.transpose()) + step.Q;
    P.topRightCorner<kRows, 3>() = step.F.lazyProduct(beside);
  } else {
    P.topLeftCorner<kRows, kRows>() = P_.topLeftCorner<kRows, kRows>();
    P.topRightCorner<kRows, 3>() = beside.topRows<kRows>();
  }
  P.bottomLeftCorner<3, kRows>() = P.topRightCorner<kRows, 3>().transpose();
  P(kOffset, kOffset) = P_(kImuOffset, kImuOffset);
  P.block<1, 2>(kOffset, kMount) = P_.block<1, 2>(kImuOffset, kMounting);
  P.block<2, 1>(kMount, kOffset) = P_.block<2, 1>(kMounting, kImuOffset);
  P.block<2, 2>(kMount, kMount) = P_.block<2, 2>(kMounting, kMounting);
  // (N.8.2): position, rotation in imu axes, velocity in imu axes.
  const Eigen::Matrix3d to_imu = x_.R().transpose();
  Eigen::Matrix<double, kSize, kInputs> J = Eigen::Matrix<double, kSize, kInputs>::Zero();
  J.block<3, 3>(0, kPos).setIdentity();
  J.block<3, 3>(0, kAtt) = -skew(x_.nav.position - p_ref_ + x_.imu_offset * x_.nav.velocity);
  J.block<3, 3>(0, kVel) = x_.imu_offset * Eigen::Matrix3d::Identity();
  J.block<3, 1>(0, kOffset) = x_.nav.velocity + x_.imu_offset * motion.acceleration;
  J.block<3, 3>(kTurn, kAtt) = to_imu;
  J.block<3, 1>(kTurn, kOffset) = motion.rate;
  J.block<3, 3>(kSpeed, kVel) = to_imu;
  J.block<3, 1>(kSpeed, kOffset) = to_imu * motion.acceleration;
  J.block<2, 2>(kAxes, kMount).setIdentity();
  const Eigen::Matrix<double, kSize, kInputs> half = J.lazyProduct(P);
  const Eigen::Matrix<double, kSize, kSize> all = half.lazyProduct(J.transpose());
  cov_ = 0.5 * (all + all.transpose());
  covariance_at_us_ = x_.t_us;
}

Odometry OutputPredictor::output() {
  Odometry out;
  const BodyMotion& motion = propagation_.motion();
  const double o = x_.imu_offset;  // the sample stamped t was taken o earlier, so t itself lies o ahead
  out.t_us = x_.t_us;
  out.T_frame_vehicle.p = x_.nav.position + o * (x_.nav.velocity + 0.5 * o * motion.acceleration);
  out.T_frame_vehicle.q = normalized_positive(x_.nav.q_level_imu * exp_q(o * motion.rate));
  const Eigen::Quaterniond to_imu = out.T_frame_vehicle.q.conjugate();
  out.velocity = to_imu * (x_.nav.velocity + o * motion.acceleration);
  // Of the newest sample: the smoothed rate is hundredths of a second late.
  out.angular_rate = propagation_.last_step().rate - to_imu * propagation_.earth().rate();
  if (covariance_at_us_ == 0 || seconds_between(covariance_at_us_, x_.t_us) >= kCovarianceAge) find_covariance();
  out.cov_pose = cov_.topLeftCorner<6, 6>();
  out.cov_velocity = cov_.block<3, 3>(kSpeed, kSpeed);
  return out;
}

Odometry OutputPredictor::in_vehicle_axes(const Odometry& imu, const VehicleFacts& facts) const {
  const Eigen::Matrix3d to_vehicle = vehicle::R_imu_vehicle(x_.mounting).transpose();
  Odometry out = imu;
  Eigen::Quaterniond& q = out.T_frame_vehicle.q;
  q = q * exp_q(Eigen::Vector3d(0.0, x_.mounting.x(), x_.mounting.y()));
  if (q.w() < 0.0) q.coeffs() = -q.coeffs();
  out.velocity = to_vehicle * imu.velocity;
  out.angular_rate = to_vehicle * imu.angular_rate;
  // What errors of (roll, pitch, yaw) of the mounting turn; of pitch and yaw with all that they are correlated with.
  Eigen::Matrix3d by_mounting = right_jacobian(Eigen::Vector3d(0.0, x_.mounting.x(), x_.mounting.y()));
  by_mounting.col(0) = Eigen::Vector3d::UnitX();
  if (!facts.mounting_known()) by_mounting.setZero();
  Eigen::Matrix<double, kAxes, kSize> J = Eigen::Matrix<double, kAxes, kSize>::Zero();
  J.topLeftCorner<3, 3>().setIdentity();
  J.block<3, 3>(kTurn, kTurn) = J.block<3, 3>(kSpeed, kSpeed) = to_vehicle;
  J.block<3, 2>(kTurn, kAxes) = by_mounting.rightCols<2>();
  J.block<3, 2>(kSpeed, kAxes) = skew(out.velocity) * by_mounting.rightCols<2>();
  Eigen::Matrix<double, kAxes, 1> by_roll = Eigen::Matrix<double, kAxes, 1>::Zero();
  by_roll.segment<3>(kTurn) = facts.mounting_std.x() * by_mounting.col(0);
  by_roll.segment<3>(kSpeed) = skew(out.velocity) * by_roll.segment<3>(kTurn);
  const Eigen::Matrix<double, kAxes, kSize> half = J.lazyProduct(cov_);
  const Eigen::Matrix<double, kAxes, kAxes> all = half.lazyProduct(J.transpose()) + by_roll * by_roll.transpose();
  out.cov_pose = 0.5 * (all.topLeftCorner<6, 6>() + all.topLeftCorner<6, 6>().transpose());
  out.cov_velocity = 0.5 * (all.block<3, 3>(kSpeed, kSpeed) + all.block<3, 3>(kSpeed, kSpeed).transpose());
  return out;
}

}  // namespace roadfix::navigation
