/// The one measurement of visual odometry: where a camera sees a point. MODEL.md (M.1)-(M.4).
#pragma once

#include <Eigen/Dense>

#include "geometry/se3.h"

namespace roadfix {

/// Points nearer than this, m, or behind the camera have no reprojection.
inline constexpr double kMinReprojectionDepth = 0.05;

/// What a calibration may have wrong, and what is estimated beside the motion. All zero: as calibrated.
/// Order of the vector: kFocal, kRadial, kRightTurn (3).
struct LensCorrection {
  static constexpr int kSize = 5;
  static constexpr int kFocal = 0;      ///< logarithm of true over calibrated focal length, both eyes
  static constexpr int kRadial = 1;     ///< coefficient of r^2 left over after undistortion, both eyes
  static constexpr int kRightTurn = 2;  ///< rad, rotation vector of the right eye about its own centre
  using Vector = Eigen::Matrix<double, kSize, 1>;
  using Matrix = Eigen::Matrix<double, kSize, kSize>;

  Vector value = Vector::Zero();

  /// Where a true direction (x/z, y/z) appears in calibrated coordinates, (M.2).
  [[nodiscard]] Eigen::Vector2d bend(const Eigen::Vector2d& direction) const;
  /// The direction that appears there.
  [[nodiscard]] Eigen::Vector2d straighten(const Eigen::Vector2d& normalised) const;
  /// T_right_left as calibrated, turned. Its length shrinks as the focal length grows: their product, which makes
  /// disparity into depth, is what a stereo calibration knows best.
  [[nodiscard]] SE3 turned(const SE3& T_right_left) const;
};

/// Derivatives of the normalised image coordinates, (M.3) and (M.4).
struct ReprojectionJacobian {
  Eigen::Matrix<double, 2, 6> pose;                            ///< by retract(T_map_camera, d)
  Eigen::Matrix<double, 2, 3> point;                           ///< by the point in the map
  Eigen::Matrix<double, 2, LensCorrection::kSize> correction;  ///< by the correction's vector
};

/// One eye at one pose, ready for many points.
class Eye {
 public:
  /// The left eye.
  Eye(const SE3& T_map_camera, const LensCorrection& lens);
  /// The right eye, T_right_left as calibrated.
  Eye(const SE3& T_map_camera, const LensCorrection& lens, const SE3& T_right_left);

  /// Calibrated normalised coordinates of a map point, (M.1); false where it is not in front.
  bool see(const Eigen::Vector3d& p_map, Eigen::Vector2d& normalised, ReprojectionJacobian* J = nullptr) const;

 private:
  LensCorrection lens_;
  bool right_;
  Eigen::Matrix3d R_camera_map_;
  Eigen::Vector3d p_map_camera_;
  Eigen::Matrix3d R_eye_camera_;
  Eigen::Vector3d p_eye_camera_;
  Eigen::Matrix3d J_turn_;  ///< of the right eye's rotation by its vector, in the eye's axes
  double scale_;
};

}  // namespace roadfix
