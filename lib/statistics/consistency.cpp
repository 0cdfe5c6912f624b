#include "statistics/consistency.h"

#include <cmath>

#include "statistics/chi_square.h"

namespace roadfix {

Band chi_square_band(int num_samples, int dof, double confidence) {
  const double total = static_cast<double>(num_samples) * dof;
  if (total <= 0.0) return {};
  const double tail = 0.5 * (1.0 - confidence);
  return {chi_square_quantile(tail, total) / total, chi_square_quantile(1.0 - tail, total) / total};
}

std::optional<double> normalised_square(const Eigen::VectorXd& error, const Eigen::MatrixXd& covariance) {
  if (!error.allFinite() || !covariance.allFinite()) return std::nullopt;
  const Eigen::LLT<Eigen::MatrixXd> factor(covariance);
  if (factor.info() != Eigen::Success) return std::nullopt;
  const Eigen::VectorXd whitened = factor.matrixL().solve(error);
  const double value = whitened.squaredNorm();
  if (!std::isfinite(value)) return std::nullopt;
  return value;
}

void ConsistencyAccumulator::add(double normalised_square, int dof) {
  sum_ += normalised_square;
  total_dof_ += dof;
  ++count_;
}

double ConsistencyAccumulator::ratio() const { return total_dof_ == 0 ? 0.0 : sum_ / total_dof_; }

Band ConsistencyAccumulator::band(double confidence) const { return chi_square_band(total_dof_, 1, confidence); }

}  // namespace roadfix
