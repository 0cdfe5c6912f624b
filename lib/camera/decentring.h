/// What a calibration leaves of a lens's decentring. Decentring (Brown, Decentering distortion of lenses, 1966) moves the
/// image of the direction n by |n|^2 p + 2 (p.n) n. A rotation and a shift of the principal point, which the same calibration
/// estimates, are nearly the same; what is not stays. MODEL.md (K.4.1).
#pragma once

#include <Eigen/Dense>

namespace roadfix {

/// Shift of the normalised image of `n`: perpendicular to it, (K.4.1).
inline Eigen::Vector2d decentring_shift(const Eigen::Vector2d& n, const Eigen::Vector2d& p) {
  return n.squaredNorm() * p - p.dot(n) * n;
}

/// Its derivative by `n`, (K.4.2).
inline Eigen::Matrix2d decentring_jacobian(const Eigen::Vector2d& n, const Eigen::Vector2d& p) {
  return 2.0 * p * n.transpose() - n * p.transpose() - p.dot(n) * Eigen::Matrix2d::Identity();
}

/// Its derivative by `p`.
inline Eigen::Matrix2d decentring_sensitivity(const Eigen::Vector2d& n) {
  return n.squaredNorm() * Eigen::Matrix2d::Identity() - n * n.transpose();
}

/// The direction whose shifted image is `shifted`.
inline Eigen::Vector2d undo_decentring(const Eigen::Vector2d& shifted, const Eigen::Vector2d& p) {
  constexpr int kSteps = 4;  // fixed-point iterations, two digits each
  Eigen::Vector2d n = shifted;
  for (int i = 0; i < kSteps; ++i) n = shifted - decentring_shift(n, p);
  return n;
}

}  // namespace roadfix
