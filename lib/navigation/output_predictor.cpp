#include "navigation/output_predictor.h"

#include "geometry/so3.h"

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
  constexpr int kRows = 9;
  const BodyMotion& motion = propagation_.motion();
  // (phi, nu, rho) now, and the clock offset.
  Eigen::Matrix<double, kRows + 1, kRows + 1> P;
  if (propagation_.duration() > 0.0) {
    const inertial::ErrorTransition step =
        propagation_.transition(x_.nav, p_ref_, propagation_.earth().gravity(x_.nav.position));
    const Eigen::Matrix<double, kRows, kInertialSize> FP =
        step.F.lazyProduct(P_.topLeftCorner<kInertialSize, kInertialSize>());
    P.topLeftCorner<kRows, kRows>() = FP.lazyProduct(step.F.transpose()) + step.Q;
    P.topRightCorner<kRows, 1>() = step.F * P_.block<kInertialSize, 1>(0, kImuOffset);
  } else {
    P.topLeftCorner<kRows, kRows>() = P_.topLeftCorner<kRows, kRows>();
    P.topRightCorner<kRows, 1>() = P_.block<kRows, 1>(0, kImuOffset);
  }
  P.bottomLeftCorner<1, kRows>() = P.topRightCorner<kRows, 1>().transpose();
  P(kRows, kRows) = P_(kImuOffset, kImuOffset);
  // (N.8.2): position, rotation in imu axes, velocity in imu axes.
  const Eigen::Matrix3d to_imu = x_.R().transpose();
  Eigen::Matrix<double, 9, kRows + 1> J = Eigen::Matrix<double, 9, kRows + 1>::Zero();
  J.block<3, 3>(0, kPos).setIdentity();
  J.block<3, 3>(0, kAtt) = -skew(x_.nav.position - p_ref_ + x_.imu_offset * x_.nav.velocity);
  J.block<3, 3>(0, kVel) = x_.imu_offset * Eigen::Matrix3d::Identity();
  J.block<3, 1>(0, kRows) = x_.nav.velocity + x_.imu_offset * motion.acceleration;
  J.block<3, 3>(3, kAtt) = to_imu;
  J.block<3, 1>(3, kRows) = motion.rate;
  J.block<3, 3>(6, kVel) = to_imu;
  J.block<3, 1>(6, kRows) = to_imu * motion.acceleration;
  const Eigen::Matrix<double, 9, kRows + 1> half = J.lazyProduct(P);
  const Eigen::Matrix<double, 9, 9> all = half.lazyProduct(J.transpose());
  cov_pose_ = 0.5 * (all.topLeftCorner<6, 6>() + all.topLeftCorner<6, 6>().transpose());
  cov_velocity_ = 0.5 * (all.block<3, 3>(6, 6) + all.block<3, 3>(6, 6).transpose());
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
  out.cov_pose = cov_pose_;
  out.cov_velocity = cov_velocity_;
  return out;
}

}  // namespace roadfix::navigation
