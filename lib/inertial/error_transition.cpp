#include "inertial/error_transition.h"

#include <cmath>

#include "geometry/so3.h"

namespace roadfix::inertial {

void TransitionSums::add(const Strapdown& x, const InertialStep& step, const ImuNoise& noise) {
  if (duration_ == 0.0) start_ = x;
  rate_ += step.dt * step.rate;
  force_ += step.dt * step.specific_force;
  gyro_variance_ += step.dt * noise.gyro * noise.gyro;
  accel_variance_ += step.dt * noise.accel * noise.accel;
  tilt_variance_ += step.dt * noise.tilt * noise.tilt;
  duration_ += step.dt;
}

ErrorTransition TransitionSums::transition(const Strapdown& end, const Eigen::Vector3d& p_ref,
                                           const Eigen::Vector3d& gravity, const Eigen::Vector3d& earth_rate) const {
  const double T = duration_;
  const Eigen::Matrix3d R = (start_.q_level_imu * exp_q(0.5 * rate_)).toRotationMatrix();  // in the middle
  const Eigen::Matrix3d G = skew(gravity), V = skew(0.5 * (start_.velocity + end.velocity)),
                        X = skew(0.5 * (start_.position + end.position) - p_ref), W = skew(earth_rate);
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
  ErrorTransition out;
  auto& F = out.F;
  F.setZero();
  // (I.2.2): homogeneous part.
  F.block<3, 3>(kAtt, kAtt) = I - T * W;
  F.block<3, 3>(kVel, kAtt) = T * (G + V * W);
  F.block<3, 3>(kVel, kVel) = I - 2.0 * T * W;
  F.block<3, 3>(kPos, kAtt) = 0.5 * T * T * G - T * X * W;
  F.block<3, 3>(kPos, kVel) = T * I;
  F.block<3, 3>(kPos, kPos) = I;
  // (I.2.3): what a constant turn error of one rad/s (imu axes) has made of (phi, nu, rho).
  const Eigen::Matrix3d by_turn[] = {T * R, (0.5 * T * T * G + T * V) * R,
                                     (T * T * T / 6.0 * G + 0.5 * T * T * V + T * X) * R};
  const Eigen::Matrix3d by_force[] = {Eigen::Matrix3d::Zero(), T * R, 0.5 * T * T * R};  // (I.2.4)
  const Eigen::Vector3d rate = rate_ / T, force = force_ / T;
  for (int i = 0; i < 3; ++i) {
    F.block<3, 3>(3 * i, kGyroBias) = -by_turn[i];
    F.block<3, 3>(3 * i, kGyroScale) = -by_turn[i] * rate.asDiagonal();
    F.block<3, 3>(3 * i, kAccelBias) = -by_force[i];
    F.block<3, 3>(3 * i, kAccelScale) = -by_force[i] * force.asDiagonal();
  }
  // (I.2.5): gyro noise enters all three; two-point Gauss quadrature of its effect over the step.
  Matrix9d& Q = out.Q;
  Q.setZero();
  for (const double sign : {-1.0, 1.0}) {
    const double t = 0.5 * T * (1.0 + sign / std::sqrt(3.0));
    Eigen::Matrix<double, 9, 3> B;
    B << I, V + t * G, X + t * V + 0.5 * t * t * G;
    Q.noalias() += 0.5 * gyro_variance_ * B.lazyProduct(B.transpose());
    if (tilt_variance_ > 0.0)
      Q.noalias() += 0.5 * tilt_variance_ * B.leftCols<2>().lazyProduct(B.leftCols<2>().transpose());
  }
  // (I.2.6): accelerometer noise.
  for (int i = 0; i < 3; ++i) {
    Q(kVel + i, kVel + i) += accel_variance_;
    Q(kVel + i, kPos + i) += 0.5 * T * accel_variance_;
    Q(kPos + i, kVel + i) += 0.5 * T * accel_variance_;
    Q(kPos + i, kPos + i) += T * T / 3.0 * accel_variance_;
  }
  return out;
}

}  // namespace roadfix::inertial
