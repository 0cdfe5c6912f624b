#include "slam/considered_errors.h"

#include "geometry/so3.h"
#include "slam/pose_covariance.h"

namespace roadfix {
namespace {

constexpr double kUnitStd = 1.0;  ///< of the logarithm of an unknown unit

}  // namespace

void ConsideredErrors::start_at(const SE3& T_map_camera) {
  begun_ = true;
  T_map_camera_ = T_map_camera;
  columns_.setZero();
  cov_drift_.setZero();
  lever_.setZero();
  reset_scale_drift();
}

Matrix6d ConsideredErrors::cov() const {
  Matrix6d cov = columns_ * columns_.transpose() + cov_drift_;
  cov.topLeftCorner<3, 3>() += kUnitStd * kUnitStd * lever_ * lever_.transpose();
  return cov;
}

void ConsideredErrors::reset_scale_drift() {
  cov_drift_scale_.setZero();
  cov_scale_ = 0.0;
}

void ConsideredErrors::propagate_to(const SE3& T_map_camera, const ScaleSigmas& sigmas, const Eigen::Vector3d& lever) {
  if (!begun_) return start_at(T_map_camera);
  const SE3 T_before_now = T_map_camera_.inverse() * T_map_camera;
  const Matrix6d F = pose_transport_jacobian(T_map_camera_, T_before_now);
  columns_ = F * columns_;
  columns_.col(0).head<3>() += sigmas.length * (T_map_camera.p - T_map_camera_.p);
  columns_.col(1).tail<3>() += sigmas.rotation * log_q(T_before_now.q);
  const double turn = sigmas.drift * T_before_now.p.norm();
  columns_.col(2).tail<3>().x() += turn;
  columns_.col(3).tail<3>().z() += turn;
  Vector6d step = Vector6d::Zero();
  step.head<3>() = T_map_camera.p - T_map_camera_.p;
  cov_drift_scale_ = (F * cov_drift_scale_).eval();
  cov_drift_ = (F * cov_drift_ * F.transpose() + cov_drift_scale_ * step.transpose() +
                step * cov_drift_scale_.transpose() + cov_scale_ * step * step.transpose())
                   .eval();
  cov_drift_scale_ += cov_scale_ * step;
  lever_ += T_map_camera.q * lever - T_map_camera_.q * lever;
  T_map_camera_ = T_map_camera;
}

void ConsideredErrors::move(const SE3& T_new_old) {
  T_map_camera_ = T_new_old * T_map_camera_;
  Matrix6d turned = Matrix6d::Identity();
  turned.topLeftCorner<3, 3>() = T_new_old.R();
  columns_ = (turned * columns_).eval();
  cov_drift_ = (turned * cov_drift_ * turned.transpose()).eval();
  cov_drift_scale_ = (turned * cov_drift_scale_).eval();
  lever_ = (T_new_old.q * lever_).eval();
}

}  // namespace roadfix
