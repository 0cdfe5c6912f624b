#include "slam/pose_graph.h"

#include <Eigen/SparseCholesky>
#include <cmath>

#include "geometry/so3.h"

namespace roadfix {
namespace {

constexpr int kIterations = 12;
constexpr double kMinRelativeDecrease = 1e-3;  ///< relative
constexpr double kLoopWidth = 5.0;             ///< sigmas, width of the Cauchy cost of loops

double cost_of(const std::vector<Sim3>& nodes, const std::vector<PoseConstraint>& constraints, size_t first_loop) {
  double sum = 0.0;
  for (size_t i = 0; i < constraints.size(); ++i) {
    const auto& t = constraints[i];
    const double r2 =
        constraint_error(t, nodes[static_cast<size_t>(t.a)], nodes[static_cast<size_t>(t.b)]).squaredNorm();
    constexpr double kWidth2 = kLoopWidth * kLoopWidth;
    sum += i < first_loop ? 0.5 * r2 : 0.5 * kWidth2 * std::log1p(r2 / kWidth2);
  }
  return sum;
}

}  // namespace

Sim3 Sim3::inverse() const {
  const Eigen::Quaterniond back = q.conjugate();
  return {back, -(back * p) / scale, 1.0 / scale};
}

Sim3 operator*(const Sim3& S_a_b, const Sim3& S_b_c) {
  return {(S_a_b.q * S_b_c.q).normalized(), S_a_b.scale * (S_a_b.q * S_b_c.p) + S_a_b.p, S_a_b.scale * S_b_c.scale};
}

Sim3 retract(const Sim3& S, const Vector7d& d) {
  return {(S.q * exp_q(d.segment<3>(3))).normalized(), S.p + d.head<3>(), S.scale * std::exp(d(6))};
}

Matrix7d whitening_of(const Matrix7d& cov) { return cov.llt().matrixL().solve(Matrix7d::Identity()); }

Vector7d constraint_error(const PoseConstraint& constraint, const Sim3& S_map_a, const Sim3& S_map_b, Matrix7d* J_a,
                          Matrix7d* J_b) {
  const Eigen::Matrix3d R_a_map = S_map_a.q.conjugate().toRotationMatrix();
  const Eigen::Vector3d p_a_b = R_a_map * (S_map_b.p - S_map_a.p) / S_map_a.scale;
  const Eigen::Quaterniond q_a_b = S_map_a.q.conjugate() * S_map_b.q;
  Vector7d r;
  r.head<3>() = p_a_b - constraint.S_a_b.p;
  r.segment<3>(3) = log_q(constraint.S_a_b.q.conjugate() * q_a_b);
  r(6) = std::log(S_map_b.scale / S_map_a.scale) - std::log(constraint.S_a_b.scale);
  if (J_a != nullptr && J_b != nullptr) {
    const Eigen::Matrix3d J_log = right_jacobian_inverse(r.segment<3>(3));
    J_a->setZero();
    J_b->setZero();
    J_b->topLeftCorner<3, 3>() = R_a_map / S_map_a.scale;
    J_a->topLeftCorner<3, 3>() = -J_b->topLeftCorner<3, 3>();
    J_a->block<3, 3>(0, 3) = skew(p_a_b);
    J_a->block<3, 1>(0, 6) = -p_a_b;
    J_b->block<3, 3>(3, 3) = J_log;
    J_a->block<3, 3>(3, 3) = -J_log * q_a_b.conjugate().toRotationMatrix();
    (*J_b)(6, 6) = 1.0;
    (*J_a)(6, 6) = -1.0;
    *J_a = constraint.whitening * *J_a;
    *J_b = constraint.whitening * *J_b;
  }
  return constraint.whitening * r;
}

double optimise(std::vector<Sim3>& nodes, const std::vector<PoseConstraint>& constraints, size_t first_loop) {
  const auto size = static_cast<Eigen::Index>(7 * (nodes.size() - 1));  // the first node is fixed
  double cost = cost_of(nodes, constraints, first_loop);
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    std::vector<Eigen::Triplet<double>> entries;
    Eigen::VectorXd b = Eigen::VectorXd::Zero(size);
    const auto add = [&](int row_node, int column_node, const Matrix7d& H) {
      if (row_node == 0 || column_node == 0 || row_node < column_node) return;  // lower triangle
      for (int r = 0; r < 7; ++r)
        for (int c = 0; c < 7; ++c) entries.emplace_back(7 * (row_node - 1) + r, 7 * (column_node - 1) + c, H(r, c));
    };
    for (size_t i = 0; i < constraints.size(); ++i) {
      const PoseConstraint& t = constraints[i];
      Matrix7d J_a, J_b;
      const Vector7d r =
          constraint_error(t, nodes[static_cast<size_t>(t.a)], nodes[static_cast<size_t>(t.b)], &J_a, &J_b);
      const double weight = i < first_loop ? 1.0 : 1.0 / (1.0 + r.squaredNorm() / (kLoopWidth * kLoopWidth));
      add(t.a, t.a, weight * J_a.transpose() * J_a);
      add(t.b, t.b, weight * J_b.transpose() * J_b);
      if (t.a > t.b) add(t.a, t.b, weight * J_a.transpose() * J_b);
      if (t.b > t.a) add(t.b, t.a, weight * J_b.transpose() * J_a);
      if (t.a > 0) b.segment<7>(7 * (t.a - 1)) -= weight * J_a.transpose() * r;
      if (t.b > 0) b.segment<7>(7 * (t.b - 1)) -= weight * J_b.transpose() * r;
    }
    Eigen::SparseMatrix<double> H(size, size);
    H.setFromTriplets(entries.begin(), entries.end());
    solver.compute(H);
    if (solver.info() != Eigen::Success) return cost;
    const Eigen::VectorXd step = solver.solve(b);
    if (!step.allFinite()) return cost;
    std::vector<Sim3> moved = nodes;
    for (size_t n = 1; n < nodes.size(); ++n) {
      moved[n] = retract(nodes[n], step.segment<7>(7 * static_cast<Eigen::Index>(n - 1)));
    }
    const double now = cost_of(moved, constraints, first_loop);
    if (!(now < cost)) return cost;
    const bool enough = cost - now < kMinRelativeDecrease * cost;
    nodes = std::move(moved);
    cost = now;
    if (enough) break;
  }
  return cost;
}

}  // namespace roadfix
