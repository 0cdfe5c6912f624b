/// Where a camera sees a point, and how that depends on everything that is estimated. Pure functions; equations:
/// lib/navigation/aiding/camera/MODEL.md, cited as (N.6.n).
///
/// Frames: frame, the filter's, level; imu; left and right eye, z along the axis. Places of views are about the
/// filter's point of reference, so that the columns of phi stay small far from the frame's origin. Error of a view (R,
/// p): R = Exp(phi) R^, p = Exp(phi) p^ + rho, frame axes; of rotations in the camera on the right; all else is added.
#pragma once

#include <Eigen/Dense>
#include <optional>
#include <span>

#include "geometry/se3.h"

namespace roadfix::navigation {

using Matrix2x3 = Eigen::Matrix<double, 2, 3>;

inline constexpr int kMaxViews = 17;
/// Of h.z, whose size is about one: nearer to the image plane no eye sees.
inline constexpr double kLeastDistanceAhead = 0.05;

/// The imu's pose when a picture was taken.
struct ViewPose {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();  ///< imu to frame
  Eigen::Vector3d p = Eigen::Vector3d::Zero();      ///< m, from the point of reference, frame axes
  double way = 0.0;                                 ///< m, length of the window's way up to here
};

/// What is estimated of the camera.
struct CameraGeometry {
  SE3 T_imu_camera;                                ///< of the left eye
  Eigen::Vector3d lens = Eigen::Vector3d::Zero();  ///< c_f, c_r, c_q of (N.6.9)
  SE3 T_left_right;                                ///< right eye's coordinates to the left one's
  /// rad/m, left eye's axes: by how much the tracks of a view pretend that the camera turned since their anchor, (N.6.20)
  Eigen::Vector3d drift = Eigen::Vector3d::Zero();
};

/// A point as one picture shows it: normalised coordinates, distortion taken out.
struct EyePoint {
  Eigen::Vector2d z = Eigen::Vector2d::Zero();
  double px = 500.0;  ///< pixels per unit of z there
};

/// What one view shows of a track.
struct ViewSighting {
  int view = 0;  ///< index in the window
  EyePoint left;
  std::optional<EyePoint> right;
  double sigma_px = 0.1;        ///< of each coordinate on its own
  double walk_px2 = 0.0;        ///< variance by which the error has moved since the sighting before
  double right_sigma_px = 0.2;  ///< of the right place against the left one
};

/// One eye as seen from the anchor: h = B (alpha, beta, 1) + inverse_depth c points to the point, (N.6.2).
struct RelativeView {
  Eigen::Matrix3d B = Eigen::Matrix3d::Identity();
  Eigen::Vector3d c = Eigen::Vector3d::Zero();

  [[nodiscard]] Eigen::Vector3d direction(const Eigen::Vector3d& f) const {
    return B * Eigen::Vector3d(f.x(), f.y(), 1.0) + f.z() * c;
  }
  [[nodiscard]] Eigen::Matrix3d by_point() const {
    Eigen::Matrix3d J;
    J << B.leftCols<2>(), c;
    return J;
  }
};

RelativeView left_view(const CameraGeometry& camera, const ViewPose& anchor, const ViewPose& view);
RelativeView right_view(const CameraGeometry& camera, const RelativeView& left);

/// Derivatives of h of the left eye by errors; those by the view's are the negative of the anchor's, (N.6.3), (N.6.4).
struct DirectionJacobian {
  Eigen::Matrix3d anchor_turn;   ///< phi of the anchor
  Eigen::Matrix3d anchor_place;  ///< rho of the anchor
  Eigen::Matrix3d camera_turn;
  Eigen::Matrix3d camera_place;
  Eigen::Matrix3d drift;
};
DirectionJacobian direction_jacobian(const CameraGeometry& camera, const ViewPose& anchor, const ViewPose& view,
                                     const RelativeView& left, const Eigen::Vector3d& f);

/// What an ideal lens would have seen, (N.6.9).
Eigen::Vector2d straightened(const CameraGeometry& camera, const Eigen::Vector2d& seen);

/// By how much less that is for each error of the lens, at the point that is expected: taken at the point seen it would
/// have that point's noise, as the residual has, and squares of it add up.
Matrix2x3 by_lens(const CameraGeometry& camera, const Eigen::Vector3d& h);

/// d (h.xy / h.z) / d h.
Matrix2x3 projection_jacobian(const Eigen::Vector3d& h);

/// Point (alpha, beta, inverse depth) of these straightened sightings in the left eye of view `anchor`, by Gauss-Newton
/// from a linear guess, (N.6.7); nothing where it does not lie before every eye, or is nearer than `nearest` m.
/// `two_eyes`: whether right places are used. `sigma_px`: of a place, all told.
std::optional<Eigen::Vector3d> triangulate(const CameraGeometry& camera, std::span<const ViewPose> views,
                                           std::span<const ViewSighting> sightings, int anchor, bool two_eyes,
                                           double sigma_px, double nearest);

}  // namespace roadfix::navigation
