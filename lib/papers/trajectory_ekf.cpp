#include "papers/trajectory_ekf.h"

#include <cmath>

#include "geometry/so3.h"

namespace roadfix {

void LiteralTrajectoryEkf::start(const Eigen::Vector2d& mean, const Eigen::Vector2d& measured, double variance) {
  mean_ = mean;
  last_ = measured;
  P_ = variance * Eigen::Matrix2d::Identity();
}

void LiteralTrajectoryEkf::add(const Eigen::Vector2d& measured) {
  if (!last_) return start(measured, measured, config_.measurement_sigma * config_.measurement_sigma);
  const Eigen::Matrix2d I = Eigen::Matrix2d::Identity();
  mean_ += measured - *last_;                               // u_t, with G = I
  P_ += config_.process_sigma * config_.process_sigma * I;  // G P G' + R_t
  const Eigen::Matrix2d K = P_ * (P_ + config_.measurement_sigma * config_.measurement_sigma * I).inverse();
  const Eigen::Vector2d innovation = measured - mean_;
  innovation_norm_ = innovation.norm();
  mean_ += K * innovation;
  P_ = (I - K) * P_;
  last_ = measured;
}

void MotionTrajectoryEkf::add(double dt, const Eigen::Vector2d& measured) {
  if (count_ < 2) return start(dt, measured);
  predict(dt);
  const double variance = config_.position_sigma * config_.position_sigma;
  const Eigen::Matrix2d S = P_.topLeftCorner<2, 2>() + variance * Eigen::Matrix2d::Identity();
  const Eigen::Matrix<double, 5, 2> K = P_.leftCols<2>() * S.inverse();
  x_ += K * (measured - x_.head<2>());
  x_(2) = wrap_angle(x_(2));
  Matrix5d I_KH = Matrix5d::Identity();  // Joseph's form: with course and turn unknown the short one loses its sign
  I_KH.leftCols<2>() -= K;
  P_ = I_KH * P_ * I_KH.transpose() + variance * K * K.transpose();
}

/// Two positions give course and speed.
void MotionTrajectoryEkf::start(double dt, const Eigen::Vector2d& measured) {
  if (count_++ == 0) {
    first_ = measured;
    x_.head<2>() = measured;
    P_.diagonal() << Eigen::Vector2d::Constant(config_.position_sigma * config_.position_sigma), 10.0, 1e3, 1.0;
    return;
  }
  const Eigen::Vector2d d = measured - first_;
  const double variance = config_.position_sigma * config_.position_sigma;
  const double length = std::max(d.norm(), config_.position_sigma);
  x_ << measured, std::atan2(d.y(), d.x()), d.norm() / dt, 0.0;
  P_.setZero();
  P_.diagonal() << variance, variance, std::min(10.0, 2.0 * variance / (length * length)), 2.0 * variance / (dt * dt),
      0.1;
}

void MotionTrajectoryEkf::predict(double dt) {
  const double direction = x_(2) + 0.5 * x_(4) * dt, d = x_(3) * dt;
  const double c = std::cos(direction), s = std::sin(direction);
  Matrix5d F = Matrix5d::Identity();
  F.col(2).head<2>() << -d * s, d * c;
  F.col(3).head<2>() << dt * c, dt * s;
  F.col(4).head<2>() << -0.5 * dt * d * s, 0.5 * dt * d * c;
  F(2, 4) = dt;
  x_.head<2>() += d * Eigen::Vector2d(c, s);
  x_(2) = wrap_angle(x_(2) + x_(4) * dt);

  const double qv = config_.speed_change * config_.speed_change, qw = config_.turn_change * config_.turn_change;
  Matrix5d Q = Matrix5d::Zero();
  const Eigen::Vector2d along(c, s);
  Q.topLeftCorner<2, 2>() = qv * dt * dt * dt / 3.0 * along * along.transpose();
  Q.block<2, 1>(0, 3) = qv * dt * dt / 2.0 * along;
  Q.block<1, 2>(3, 0) = Q.block<2, 1>(0, 3).transpose();
  Q(3, 3) = qv * dt;
  Q(2, 2) = qw * dt * dt * dt / 3.0;
  Q(2, 4) = Q(4, 2) = qw * dt * dt / 2.0;
  Q(4, 4) = qw * dt;
  P_ = F * P_ * F.transpose() + Q;
}

}  // namespace roadfix
