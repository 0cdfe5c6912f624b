#include "papers/frame_tie.h"

#include <cmath>

#include "geometry/euler.h"
#include "geometry/so3.h"

namespace roadfix {
namespace {

Eigen::Quaterniond about_up(double yaw) { return quaternion({yaw, 0.0, 0.0}); }

}  // namespace

Eigen::Vector3d tied_position(const FrameTie::Vector5d& x, const Eigen::Vector3d& step_vo) {
  return x.head<3>() + std::exp(x(FrameTie::kLogScale)) * (about_up(x(FrameTie::kYaw)) * step_vo);
}

Eigen::Matrix<double, 3, 5> tied_position_jacobian(const FrameTie::Vector5d& x, const Eigen::Vector3d& step_vo) {
  const Eigen::Vector3d d = tied_position(x, step_vo) - x.head<3>();
  Eigen::Matrix<double, 3, 5> J;
  J.leftCols<3>().setIdentity();
  J.col(FrameTie::kYaw) << -d.y(), d.x(), 0.0;
  J.col(FrameTie::kLogScale) = d;
  return J;
}

void FrameTie::start(const SE3& T_vo_vehicle, const SE3& T_enu_vehicle, const Eigen::Matrix4d& cov_enu,
                     const TieNoise& noise) {
  reference_ = T_vo_vehicle.p;
  x_ << T_enu_vehicle.p, wrap_angle(yaw_of(T_enu_vehicle.q) - yaw_of(T_vo_vehicle.q)), 0.0;
  P_.setZero();
  P_.topLeftCorner<4, 4>() = cov_enu;
  P_(kLogScale, kLogScale) = noise.scale_std * noise.scale_std;
  valid_ = true;
}

void FrameTie::move_to(const SE3& T_vo_vehicle, const TieNoise& noise) {
  const Eigen::Vector3d step = T_vo_vehicle.p - reference_;
  const double way = std::exp(x_(kLogScale)) * step.norm();
  Matrix5d F = Matrix5d::Identity();
  F.topRows<3>() = tied_position_jacobian(x_, step);
  x_.head<3>() = tied_position(x_, step);
  reference_ = T_vo_vehicle.p;
  P_ = F * P_ * F.transpose();
  P_.diagonal().head<3>().array() += noise.position * noise.position * way;
  P_(kYaw, kYaw) += noise.yaw * noise.yaw * way;
  P_(kLogScale, kLogScale) += noise.scale * noise.scale * way;
}

void FrameTie::correct(const SE3& T_vo_vehicle, const SE3& T_enu_vehicle, const Eigen::Matrix4d& cov_enu) {
  Eigen::Vector4d innovation;
  innovation << T_enu_vehicle.p - x_.head<3>(), wrap_angle(yaw_of(T_enu_vehicle.q) - yaw_of(T_vo_vehicle.q) - x_(kYaw));
  const Eigen::Matrix4d S = P_.topLeftCorner<4, 4>() + cov_enu;
  const Eigen::Matrix<double, 5, 4> K = P_.leftCols<4>() * S.inverse();
  x_ += K * innovation;
  x_(kYaw) = wrap_angle(x_(kYaw));
  P_ -= K * S * K.transpose();
  P_ = 0.5 * (P_ + P_.transpose()).eval();
}

double FrameTie::scale() const { return std::exp(x_(kLogScale)); }

SE3 FrameTie::to_enu(const SE3& T_vo_vehicle) const {
  return {about_up(x_(kYaw)) * T_vo_vehicle.q, tied_position(x_, T_vo_vehicle.p - reference_)};
}

Eigen::Vector3d FrameTie::origin() const { return tied_position(x_, -reference_); }

}  // namespace roadfix
