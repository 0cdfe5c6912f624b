/// Pose graph optimisation with similarity constraints, for loop closure. MODEL.md (S.12.2)-(S.12.4).
#pragma once

#include <vector>

#include "geometry/se3.h"

namespace roadfix {

/// Similarity: takes coordinates of b to a, p_a = scale * (q * p_b) + p.
struct Sim3 {
  Eigen::Quaterniond q = Eigen::Quaterniond::Identity();
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  double scale = 1.0;

  [[nodiscard]] Sim3 inverse() const;
  [[nodiscard]] SE3 rigid() const { return {q, p}; }
};

Sim3 operator*(const Sim3& S_a_b, const Sim3& S_b_c);

using Vector7d = Eigen::Matrix<double, 7, 1>;
using Matrix7d = Eigen::Matrix<double, 7, 7>;

/// Perturbation: [p in a's axes, rotation in b's axes, logarithm of the scale].
Sim3 retract(const Sim3& S, const Vector7d& d);

/// Measured similarity of node b relative to node a.
struct PoseConstraint {
  int a = 0, b = 0;
  Sim3 S_a_b;
  Matrix7d whitening = Matrix7d::Identity();  ///< of the error, W'W = inverse of its covariance
};

/// The lower triangular W of a positive definite covariance.
Matrix7d whitening_of(const Matrix7d& cov);

/// Residual of a constraint, whitened, and its Jacobians by the perturbations of both nodes, (S.12.3).
Vector7d constraint_error(const PoseConstraint& constraint, const Sim3& S_map_a, const Sim3& S_map_b,
                          Matrix7d* J_a = nullptr, Matrix7d* J_b = nullptr);

/// Gauss-Newton; the first node is fixed. Robust to wrong constraints from `first_loop` on (Cauchy weights). Returns half
/// the final sum of squares.
double optimise(std::vector<Sim3>& nodes, const std::vector<PoseConstraint>& constraints, size_t first_loop);

}  // namespace roadfix
