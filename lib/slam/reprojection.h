/// Reprojection of a point into a camera. MODEL.md (S.2.1)-(S.2.4).
#pragma once

#include <Eigen/Dense>

#include "camera/decentring.h"
#include "geometry/se3.h"

namespace roadfix {

/// Points closer than this, m, or behind the camera have no reprojection.
inline constexpr double kMinReprojectionDepth = 0.05;

/// Correction of the calibration, estimated beside the motion; zero: as calibrated. Order of the vector: kFocal,
/// kRadial, kRightRotation (3), kRightDecentring (2).
struct LensCorrection {
  static constexpr int kSize = 7;
  static constexpr int kFocal = 0;            ///< logarithm of true over calibrated focal length, both cameras
  static constexpr int kRadial = 1;           ///< coefficient of r^2 remaining after undistortion, both cameras
  static constexpr int kRightRotation = 2;    ///< rad, rotation vector of the right camera about its own centre
  static constexpr int kRightDecentring = 5;  ///< of the right camera against the left, camera/decentring.h
  using Vector = Eigen::Matrix<double, kSize, 1>;
  using Matrix = Eigen::Matrix<double, kSize, kSize>;

  Vector value = Vector::Zero();

  /// Calibrated coordinates of a true direction (x/z, y/z), (S.2.2).
  [[nodiscard]] Eigen::Vector2d apply(const Eigen::Vector2d& direction) const;
  /// Inverse of apply().
  [[nodiscard]] Eigen::Vector2d remove(const Eigen::Vector2d& normalised) const;
  /// Calibrated coordinates in the right camera of a true direction of it, and the inverse.
  [[nodiscard]] Eigen::Vector2d apply_right(const Eigen::Vector2d& direction) const;
  [[nodiscard]] Eigen::Vector2d remove_right(const Eigen::Vector2d& normalised) const;
  [[nodiscard]] Eigen::Vector2d right_decentring() const { return value.segment<2>(kRightDecentring); }
  /// T_right_left as calibrated, with the corrected rotation. The baseline is divided by the focal length correction:
  /// their product, which converts disparity to depth, is what a stereo calibration determines best.
  [[nodiscard]] SE3 corrected_extrinsics(const SE3& T_right_left) const;
};

/// Jacobians of the normalised image coordinates, (S.2.3) and (S.2.4).
struct ReprojectionJacobian {
  Eigen::Matrix<double, 2, 6> pose;                            ///< by retract(T_map_camera, d)
  Eigen::Matrix<double, 2, 3> point;                           ///< by the point in the map
  Eigen::Matrix<double, 2, LensCorrection::kSize> correction;  ///< by the correction's vector
};

/// One camera at one pose, with precomputed terms.
class PosedCamera {
 public:
  /// The left camera.
  PosedCamera(const SE3& T_map_camera, const LensCorrection& lens);
  /// The right camera, T_right_left as calibrated.
  PosedCamera(const SE3& T_map_camera, const LensCorrection& lens, const SE3& T_right_left);

  /// Calibrated normalised coordinates of a map point, (S.2.1); false where it is not in front of the camera.
  bool project(const Eigen::Vector3d& p_map, Eigen::Vector2d& normalised, ReprojectionJacobian* J = nullptr) const;

 private:
  LensCorrection lens_;
  bool right_;
  Eigen::Matrix3d R_camera_map_;
  Eigen::Vector3d p_map_camera_;
  Eigen::Matrix3d R_eye_camera_;
  Eigen::Vector3d p_eye_camera_;
  Eigen::Matrix3d J_rotation_;  ///< of the right camera's rotation by its vector, in the camera's axes
  double scale_;
};

}  // namespace roadfix
