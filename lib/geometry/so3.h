/// Rotations: exponential map, logarithm and their Jacobians (Sola, Deray, Atchuthan, A micro Lie theory, 2018,
/// section 4.B and appendix B).
///
/// Convention: right perturbation, R * Exp(theta) with theta in the axes on the right; every Jacobian here is a right
/// Jacobian.
#pragma once

#include <Eigen/Dense>

namespace roadfix {

/// Cross-product matrix: skew(a) * b = a x b.
Eigen::Matrix3d skew(const Eigen::Vector3d& a);

/// Rotation by |theta| rad about theta; exact to rounding at any size, zero included.
Eigen::Quaterniond exp_q(const Eigen::Vector3d& theta);
Eigen::Matrix3d exp_so3(const Eigen::Vector3d& theta);

/// Rotation vector of q, |theta| <= pi; q and -q give the same.
Eigen::Vector3d log_q(const Eigen::Quaterniond& q);
Eigen::Vector3d log_so3(const Eigen::Matrix3d& R);

/// Right Jacobian: Exp(theta + d) = Exp(theta) Exp(Jr(theta) d) to first order; and its inverse.
Eigen::Matrix3d right_jacobian(const Eigen::Vector3d& theta);
Eigen::Matrix3d right_jacobian_inverse(const Eigen::Vector3d& theta);

/// q with unit norm and w >= 0; |q| must not be zero.
Eigen::Quaterniond normalized_positive(const Eigen::Quaterniond& q);

/// angle - 2 pi k in (-pi, pi].
double wrap_angle(double angle);

}  // namespace roadfix
