/// Poses along a way, tied by how each was seen from others, moved so that all ties fit best: what closes a loop.
/// MODEL.md (M.18)-(M.20).
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

/// Node b seen from node a.
struct PoseTie {
  int a = 0, b = 0;
  Sim3 S_a_b;
  Vector7d sigma = Vector7d::Ones();  ///< of position, rotation and scale
};

/// How far two nodes are from what a tie says, in sigmas, and its derivatives by their perturbations, (M.19).
Vector7d tie_error(const PoseTie& tie, const Sim3& S_map_a, const Sim3& S_map_b, Matrix7d* J_a = nullptr,
                   Matrix7d* J_b = nullptr);

/// Gauss-Newton; the first node stays. `with_scale`: false keeps every scale as it is. Robust against wrong ties from
/// `first_loop` on (Cauchy weights). Returns half the sum of squares after it.
double optimise(std::vector<Sim3>& nodes, const std::vector<PoseTie>& ties, size_t first_loop, bool with_scale);

}  // namespace roadfix
