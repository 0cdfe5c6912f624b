#include "slam/reprojection.h"

#include <cmath>

#include "geometry/so3.h"

namespace roadfix {

Eigen::Vector2d LensCorrection::apply(const Eigen::Vector2d& direction) const {
  return std::exp(value(kFocal)) * (1.0 + value(kRadial) * direction.squaredNorm()) * direction;
}

Eigen::Vector2d LensCorrection::remove(const Eigen::Vector2d& normalised) const {
  constexpr int kSteps = 6;  // fixed-point iterations, two digits each: the coefficient is a few hundredths
  const Eigen::Vector2d scaled = std::exp(-value(kFocal)) * normalised;
  Eigen::Vector2d direction = scaled;
  for (int i = 0; i < kSteps; ++i) direction = scaled / (1.0 + value(kRadial) * direction.squaredNorm());
  return direction;
}

Eigen::Vector2d LensCorrection::apply_right(const Eigen::Vector2d& direction) const {
  return apply(direction) + decentring_shift(direction, right_decentring());
}

Eigen::Vector2d LensCorrection::remove_right(const Eigen::Vector2d& normalised) const {
  constexpr int kSteps = 4;  // as in undo_decentring()
  Eigen::Vector2d direction = remove(normalised);
  for (int i = 0; i < kSteps; ++i) direction = remove(normalised - decentring_shift(direction, right_decentring()));
  return direction;
}

SE3 LensCorrection::corrected_extrinsics(const SE3& T_right_left) const {
  const SE3 turn{exp_q(value.segment<3>(kRightRotation)), Eigen::Vector3d::Zero()};
  return turn * SE3{T_right_left.q, std::exp(-value(kFocal)) * T_right_left.p};
}

PosedCamera::PosedCamera(const SE3& T_map_camera, const LensCorrection& lens)
    : lens_(lens),
      right_(false),
      R_camera_map_(T_map_camera.R().transpose()),
      p_map_camera_(T_map_camera.p),
      R_eye_camera_(Eigen::Matrix3d::Identity()),
      p_eye_camera_(Eigen::Vector3d::Zero()),
      scale_(std::exp(lens.value(LensCorrection::kFocal))) {}

PosedCamera::PosedCamera(const SE3& T_map_camera, const LensCorrection& lens, const SE3& T_right_left)
    : PosedCamera(T_map_camera, lens) {
  right_ = true;
  const SE3 T_eye_camera = lens.corrected_extrinsics(T_right_left);
  R_eye_camera_ = T_eye_camera.R();
  p_eye_camera_ = T_eye_camera.p;
  J_rotation_ = right_jacobian(-lens.value.segment<3>(LensCorrection::kRightRotation));  // the left Jacobian
}

bool PosedCamera::project(const Eigen::Vector3d& p_map, Eigen::Vector2d& normalised, ReprojectionJacobian* J) const {
  const Eigen::Vector3d p_camera = R_camera_map_ * (p_map - p_map_camera_);
  const Eigen::Vector3d p_eye = R_eye_camera_ * p_camera + p_eye_camera_;
  if (!(p_eye.z() > kMinReprojectionDepth)) return false;
  const double inverse_depth = 1.0 / p_eye.z();
  const Eigen::Vector2d n = p_eye.head<2>() * inverse_depth;
  const double r2 = n.squaredNorm(), radial = lens_.value(LensCorrection::kRadial);
  const Eigen::Vector2d bent = scale_ * (1.0 + radial * r2) * n;
  normalised = bent;
  if (right_) normalised += decentring_shift(n, lens_.right_decentring());
  if (J == nullptr) return true;

  Eigen::Matrix<double, 2, 3> J_perspective;
  J_perspective << inverse_depth, 0.0, -n.x() * inverse_depth, 0.0, inverse_depth, -n.y() * inverse_depth;
  Eigen::Matrix2d J_bend =
      scale_ * ((1.0 + radial * r2) * Eigen::Matrix2d::Identity() + 2.0 * radial * n * n.transpose());
  if (right_) J_bend += decentring_jacobian(n, lens_.right_decentring());
  const Eigen::Matrix<double, 2, 3> J_eye = J_bend * J_perspective;
  const Eigen::Matrix<double, 2, 3> J_camera = J_eye * R_eye_camera_;
  J->point = J_camera * R_camera_map_;
  J->pose.leftCols<3>() = -J->point;
  J->pose.rightCols<3>() = J_camera * skew(p_camera);
  J->correction.col(LensCorrection::kFocal) = bent;
  J->correction.col(LensCorrection::kRadial) = scale_ * r2 * n;
  J->correction.rightCols<LensCorrection::kSize - LensCorrection::kRightRotation>().setZero();
  if (right_) {
    J->correction.col(LensCorrection::kFocal) -= J_eye * p_eye_camera_;
    J->correction.middleCols<2>(LensCorrection::kRightDecentring) = decentring_sensitivity(n);
    J->correction.middleCols<3>(LensCorrection::kRightRotation) = -J_eye * skew(p_eye) * J_rotation_;
  }
  return true;
}

}  // namespace roadfix
