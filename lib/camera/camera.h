/// A camera's projection: pinhole, with radial-tangential (Brown-Conrady, OpenCV's k1 k2 p1 p2 k3) or equidistant
/// (Kannala and Brandt 2006, OpenCV's fisheye k1 k2 k3 k4) distortion.
///
/// Two kinds of image coordinates: a *pixel* is a raw image coordinate (u to the right, v down, the centre of the first
/// pixel at 0 0); *normalised* coordinates are (x/z, y/z) of a point in camera axes, without distortion. Estimators use
/// normalised coordinates: undistortion is computed once per feature. Derivation: lib/camera/MODEL.md, (K.n).
#pragma once

#include <Eigen/Dense>
#include <array>
#include <optional>

namespace roadfix {

enum class Distortion { kNone, kRadTan, kEquidistant };

struct CameraIntrinsics {
  int width = 0;  ///< px
  int height = 0;
  double fx = 0.0;  ///< px
  double fy = 0.0;
  double cx = 0.0;
  double cy = 0.0;
  Distortion distortion = Distortion::kNone;
  std::array<double, 5> coefficients{};  ///< radtan: k1 k2 p1 p2 k3; equidistant: k1 k2 k3 k4
};

using Matrix23d = Eigen::Matrix<double, 2, 3>;

class Camera {
 public:
  explicit Camera(const CameraIntrinsics& intrinsics);

  /// Pixel of a point in camera axes and, optionally, its Jacobian by the point. No value for a point that is not in
  /// front of the camera or beyond the radius where the distortion polynomial is no longer monotonic.
  [[nodiscard]] std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& p_camera,
                                                       Matrix23d* J_point = nullptr) const;

  /// Normalised coordinates of a pixel; no value outside the valid range of the distortion model.
  [[nodiscard]] std::optional<Eigen::Vector2d> unproject(const Eigen::Vector2d& pixel) const;

  /// Pixel of normalised coordinates and, optionally, its Jacobian.
  [[nodiscard]] std::optional<Eigen::Vector2d> distort(const Eigen::Vector2d& normalised,
                                                       Eigen::Matrix2d* J_normalised = nullptr) const;

  /// Inside the image, at least `border` pixels from its edge.
  [[nodiscard]] bool sees(const Eigen::Vector2d& pixel, double border = 0.0) const;

  /// Pixels per unit of normalised coordinates at the centre: converts residuals to pixels.
  [[nodiscard]] double focal() const { return 0.5 * (intrinsics_.fx + intrinsics_.fy); }
  [[nodiscard]] const CameraIntrinsics& intrinsics() const { return intrinsics_; }

 private:
  CameraIntrinsics intrinsics_;
  double max_radius_ = 0.0;  ///< normalised, end of the valid range of the distortion model
};

}  // namespace roadfix
