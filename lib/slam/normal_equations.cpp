#include "slam/normal_equations.h"

namespace roadfix {
namespace {

constexpr int kLens = LensCorrection::kSize;
constexpr double kMinPointInformation = 1e-9;                   ///< regularises a point without parallax
constexpr double kViewPrior = 100.0, kViewRotationPrior = 1.0;  ///< m, rad: prior of a view without constraints

/// For a lower triangle or a full matrix: `rows` of views.
void add_view_information(Eigen::MatrixXd& H, int rows) {
  for (int row = 0; row < rows; row += 6) {
    H.diagonal().segment<3>(row).array() += 1.0 / (kViewPrior * kViewPrior);
    H.diagonal().segment<3>(row + 3).array() += 1.0 / (kViewRotationPrior * kViewRotationPrior);
  }
}

/// F with F F' = A, for a symmetric A, positive semidefinite up to rounding.
Eigen::MatrixXd square_root(const Eigen::MatrixXd& A) {
  const Eigen::LDLT<Eigen::MatrixXd> ldlt(A);
  const Eigen::MatrixXd L = ldlt.matrixL();
  return ldlt.transpositionsP().transpose() * (L * ldlt.vectorD().cwiseMax(0.0).cwiseSqrt().asDiagonal());
}

}  // namespace

NormalEquations::NormalEquations(int num_free_views, size_t num_points, size_t num_observations)
    : lens_row_(6 * num_free_views),
      H_(Eigen::MatrixXd::Zero(lens_row_ + kLens, lens_row_ + kLens)),
      b_(Eigen::VectorXd::Zero(lens_row_ + kLens)),
      H_prior_(H_),
      points_(num_points) {
  links_.reserve(num_observations);
}

void NormalEquations::add(int free_view, size_t point, const ReprojectionJacobian& J, const Eigen::Vector2d& residual,
                          Weight weight) {
  Point& p = points_[point];
  p.score_curvature = weight.score_curvature;
  const Eigen::Vector2d pull = weight.slope * residual;
  const Eigen::Matrix<double, 3, 2> Jp = weight.curvature * J.point.transpose();
  p.H.noalias() += Jp * J.point;
  p.b.noalias() += J.point.transpose() * pull;
  const Eigen::Matrix<double, kLens, 2> Jl = weight.curvature * J.correction.transpose();
  const LensCorrection::Vector b_lens = J.correction.transpose() * pull;
  p.W_lens.noalias() += Jl * J.point;
  H_.block<kLens, kLens>(lens_row_, lens_row_).noalias() += Jl * J.correction;
  p.b_lens += b_lens;
  b_.segment<kLens>(lens_row_) += b_lens;
  if (free_view < 0) return;
  const Eigen::Matrix<double, 6, 2> Jv = weight.curvature * J.pose.transpose();
  const int row = 6 * free_view;
  H_.block<6, 6>(row, row).noalias() += Jv * J.pose;
  H_.block<kLens, 6>(lens_row_, row).noalias() += Jl * J.pose;
  const Vector6d b = J.pose.transpose() * pull;
  b_.segment<6>(row) += b;
  if (p.links_end == links_.size() && p.links_end > 0 && links_.back().free_view == free_view) {
    links_.back().W.noalias() += Jv * J.point;  // the other camera of the same view
    links_.back().b += b;
  } else {
    links_.push_back({free_view, Jv * J.point, b});
    p.links_end = links_.size();
  }
}

void NormalEquations::add_distance(int free_a, int free_b, const Eigen::Vector3d& J_b, double residual) {
  const Eigen::Matrix3d H = J_b * J_b.transpose();
  const auto add = [&](int row, int column, double sign) {
    H_.block<3, 3>(row, column) += sign * H;
    H_prior_.block<3, 3>(row, column) += sign * H;
  };
  if (free_a >= 0) {
    add(6 * free_a, 6 * free_a, 1.0);
    b_.segment<3>(6 * free_a) -= residual * J_b;
  }
  if (free_b >= 0) {
    add(6 * free_b, 6 * free_b, 1.0);
    b_.segment<3>(6 * free_b) += residual * J_b;
  }
  if (free_a >= 0 && free_b >= 0) add(6 * std::max(free_a, free_b), 6 * std::min(free_a, free_b), -1.0);
}

void NormalEquations::add_relative_pose(int free_a, int free_b, const Matrix6d& J_a, const Matrix6d& J_b,
                                        const Vector6d& residual) {
  const auto add = [&](int row, int column, const Matrix6d& H) {
    H_.block<6, 6>(6 * row, 6 * column) += H;
    H_prior_.block<6, 6>(6 * row, 6 * column) += H;
  };
  if (free_a >= 0) {
    add(free_a, free_a, J_a.transpose() * J_a);
    b_.segment<6>(6 * free_a) += J_a.transpose() * residual;
  }
  if (free_b >= 0) {
    add(free_b, free_b, J_b.transpose() * J_b);
    b_.segment<6>(6 * free_b) += J_b.transpose() * residual;
  }
  if (free_a >= 0 && free_b >= 0) add(free_b, free_a, J_b.transpose() * J_a);
}

void NormalEquations::add_lens_prior(const LensCorrection::Matrix& information,
                                     const LensCorrection::Vector& residual) {
  H_.block<kLens, kLens>(lens_row_, lens_row_) += information;
  H_prior_.block<kLens, kLens>(lens_row_, lens_row_) += information;
  b_.segment<kLens>(lens_row_) += information * residual;
}

NormalEquations::Reduced NormalEquations::reduce(double damping) const {
  Reduced r{H_, b_, {}};
  r.S.diagonal() *= 1.0 + damping;
  r.inverse_H.reserve(points_.size());
  std::vector<Matrix63d> Y;
  size_t begin = 0;
  for (const Point& point : points_) {
    Eigen::Matrix3d H = point.H;
    H.diagonal() *= 1.0 + damping;
    H.diagonal().array() += kMinPointInformation;
    r.inverse_H.emplace_back(H.inverse());
    const MatrixL3d Y_lens = point.W_lens * r.inverse_H.back();
    r.S.block<kLens, kLens>(lens_row_, lens_row_).noalias() -= Y_lens * point.W_lens.transpose();
    r.s.segment<kLens>(lens_row_).noalias() -= Y_lens * point.b;
    const size_t end = std::max(begin, point.links_end);
    Y.clear();
    for (size_t i = begin; i < end; ++i) {
      const int row = 6 * links_[i].free_view;
      Y.emplace_back(links_[i].W * r.inverse_H.back());
      r.s.segment<6>(row).noalias() -= Y.back() * point.b;
      r.S.block<kLens, 6>(lens_row_, row).noalias() -= Y_lens * links_[i].W.transpose();
      for (size_t j = begin; j <= i; ++j) {  // views ascend within a point: lower triangle
        r.S.block<6, 6>(row, 6 * links_[j].free_view).noalias() -= Y.back() * links_[j].W.transpose();
      }
    }
    begin = end;
  }
  return r;
}

NormalEquations::Step NormalEquations::solve(double damping) const {
  const Reduced r = reduce(damping);
  const Eigen::VectorXd x = r.S.selfadjointView<Eigen::Lower>().ldlt().solve(r.s);
  Step step{x.head(lens_row_), x.tail<kLens>(), {}};
  step.points.reserve(points_.size());
  size_t begin = 0;
  for (size_t p = 0; p < points_.size(); ++p) {  // (S.7.10)
    Eigen::Vector3d b = points_[p].b - points_[p].W_lens.transpose() * step.lens;
    const size_t end = std::max(begin, points_[p].links_end);
    for (size_t i = begin; i < end; ++i) {
      b.noalias() -= links_[i].W.transpose() * step.views.segment<6>(6 * links_[i].free_view);
    }
    begin = end;
    step.points.emplace_back(r.inverse_H[p] * b);
  }
  return step;
}

template <class Factor>
size_t NormalEquations::add_scores(Eigen::MatrixXd& lower, Factor factor) const {
  size_t begin = 0, clusters = 0;
  std::vector<Vector6d> score;
  for (const Point& point : points_) {
    const size_t end = std::max(begin, point.links_end);
    if (end > begin) {
      ++clusters;
      const double times = factor(point);
      Eigen::Matrix3d H = point.H;
      H.diagonal().array() += kMinPointInformation;
      const Eigen::Vector3d shift = H.ldlt().solve(point.b);
      const LensCorrection::Vector lens = point.b_lens - point.W_lens * shift;
      score.clear();
      for (size_t i = begin; i < end; ++i) score.emplace_back(links_[i].b - links_[i].W * shift);
      for (size_t i = begin; i < end; ++i) {
        const int row = 6 * links_[i].free_view;
        lower.block<kLens, 6>(lens_row_, row).noalias() += times * lens * score[i - begin].transpose();
        for (size_t j = begin; j <= i; ++j) {
          lower.block<6, 6>(row, 6 * links_[j].free_view).noalias() +=
              times * score[i - begin] * score[j - begin].transpose();
        }
      }
      lower.block<kLens, kLens>(lens_row_, lens_row_).noalias() += times * lens * lens.transpose();
    }
    begin = end;
  }
  return clusters;
}

Eigen::MatrixXd NormalEquations::covariance() const {
  Reduced r = reduce(0.0);
  add_scores(r.S, [](const Point& point) { return -point.score_curvature; });
  add_view_information(r.S, lens_row_);
  const Eigen::Index n = r.S.rows();
  return r.S.selfadjointView<Eigen::Lower>().ldlt().solve(Eigen::MatrixXd::Identity(n, n));
}

Eigen::MatrixXd NormalEquations::clustered_covariance(const Eigen::MatrixXd& covariance) const {
  // Priors contribute with their information.
  Eigen::MatrixXd scatter = H_prior_;
  add_view_information(scatter, lens_row_);
  const size_t clusters = add_scores(scatter, [](const Point&) { return 1.0; });
  // Small-sample correction. A track with fully correlated errors still contributes two residuals.
  const auto n = 2.0 * static_cast<double>(clusters), unknowns = static_cast<double>(scatter.rows());
  const double shrunk = n > 2.0 * unknowns ? n / (n - unknowns) : 2.0;
  const Eigen::MatrixXd draws = covariance * square_root(scatter.selfadjointView<Eigen::Lower>());
  return shrunk * draws * draws.transpose();  // a square: positive semidefinite despite rounding
}

}  // namespace roadfix
