/// Where a point appears, and how that depends on everything that is estimated, (M.13)-(M.17).
#pragma once

#include <optional>

#include "msckf/tracks.h"

namespace roadfix::msckf {

using Matrix2x3 = Eigen::Matrix<double, 2, 3>;

/// One camera as seen from the anchor: h = B (alpha, beta, 1) + inverse_depth c points to the point.
struct RelativeView {
  Eigen::Matrix3d B;
  Eigen::Vector3d c;

  [[nodiscard]] Eigen::Vector3d direction(const Eigen::Vector3d& f) const {
    return B * Eigen::Vector3d(f.x(), f.y(), 1.0) + f.z() * c;
  }
  [[nodiscard]] Eigen::Matrix3d by_point() const {
    Eigen::Matrix3d J;
    J << B.leftCols<2>(), c;
    return J;
  }
};

RelativeView left_view(const Calibrated& camera, const Clone& anchor, const Clone& clone);
RelativeView right_view(const RelativeView& left, const SE3& T_left_right);

/// Derivatives of h of the left view by errors; those by the clone's are the negative of the anchor's.
struct DirectionJacobian {
  Eigen::Matrix3d anchor_turn;   ///< phi of the anchor
  Eigen::Matrix3d anchor_place;  ///< rho of the anchor
  Eigen::Matrix3d camera_turn;
  Eigen::Matrix3d camera_place;
};
DirectionJacobian direction_jacobian(const Calibrated& camera, const Clone& anchor, const Clone& clone,
                                     const RelativeView& left, const Eigen::Vector3d& f);

/// What an ideal lens would have seen, (M.48).
Eigen::Vector2d straightened(const Calibrated& camera, const Eigen::Vector2d& seen);

/// By how much less that is for each error of the lens, at the point that is expected: taken at the point seen it would
/// have that point's noise, as the residual has, and squares of it add up.
Matrix2x3 by_lens(const Calibrated& camera, const Eigen::Vector3d& h);

/// d (h.xy / h.z) / d h.
Matrix2x3 projection_jacobian(const Eigen::Vector3d& h);

/// Point (alpha, beta, inverse depth) of these sightings in the camera of the clone `anchor`, by Gauss-Newton from a
/// linear guess, (M.18); nothing where it does not lie before every camera, or its distance cannot be.
std::optional<Eigen::Vector3d> triangulate(const State& state, std::span<const Sighting> sightings, const Clone& anchor,
                                           const std::optional<SE3>& T_left_right, double sigma_px, double nearest);

}  // namespace roadfix::msckf
