/// Normalised errors (NEES) and innovations (NIS): are an estimator's covariances what its errors are?
#pragma once

#include <Eigen/Dense>
#include <optional>

namespace roadfix {

struct Band {
  double low = 0.0;
  double high = 0.0;
  [[nodiscard]] bool holds(double value) const { return low <= value && value <= high; }
};

/// Two-sided band of a mean of N independent chi-square variables of dof degrees, divided by dof; around one. For
/// example N = 50, dof = 15 at 99.9 %: 0.84 to 1.18.
Band chi_square_band(int num_samples, int dof, double confidence = 0.999);

/// error' covariance^-1 error; nothing where the covariance is not positive definite or a value is not finite.
std::optional<double> normalised_square(const Eigen::VectorXd& error, const Eigen::MatrixXd& covariance);

/// Collects normalised squares of any mix of degrees of freedom. The band is right only for independent samples: one
/// per run at a fixed epoch, never along the time of one run (errors are correlated).
class ConsistencyAccumulator {
 public:
  void add(double normalised_square, int dof);

  [[nodiscard]] int count() const { return count_; }
  /// Sum over total degrees of freedom: one where they are consistent, more where too small. Zero without samples.
  [[nodiscard]] double ratio() const;
  [[nodiscard]] Band band(double confidence = 0.999) const;
  [[nodiscard]] bool consistent(double confidence = 0.999) const { return band(confidence).holds(ratio()); }

 private:
  double sum_ = 0.0;
  int count_ = 0;
  int total_dof_ = 0;
};

}  // namespace roadfix
