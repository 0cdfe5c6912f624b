/// Statistics of the innovations of an estimate's GNSS positions: how large they are beside their claims, whether their
/// mean is so by chance, and when the last position was used or rejected. lib/integrity/MODEL.md, (P.2.n) and (P.3.2).
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <optional>

#include "integrity/error_scale.h"
#include "integrity/integrity_config.h"

namespace roadfix {

/// One attempt of the estimator to use a GNSS position.
struct PositionInnovation {
  int64_t t_us = 0;
  bool accepted = false;
  double nis = 0.0;
  int dof = 0;
  Eigen::Vector3d innovation = Eigen::Vector3d::Zero();  ///< m, enu; what has no third axis leaves it zero
  Eigen::Vector3d variance = Eigen::Vector3d::Zero();    ///< m2, of it
};

class PositionInnovations {
 public:
  explicit PositionInnovations(const ErrorScaleConfig& tails) : noise_(tails), whiteness_(tails) {}

  void add(const PositionInnovation& innovation);
  /// The mean over a few seconds is larger than a mean of independent ones is with this probability, (P.3.2).
  [[nodiscard]] bool biased(double risk) const;
  /// The mean is one of sound positions.
  void learn();
  /// Sigmas that an error exceeds with probability `risk`.
  [[nodiscard]] double quantile(int64_t t_us, double risk) const { return noise_.quantile(t_us, risk); }

  /// m2, enu, of the last used position's innovation.
  [[nodiscard]] const Eigen::Vector3d& variance() const { return variance_; }
  [[nodiscard]] std::optional<int64_t> used_us() const { return used_us_; }
  [[nodiscard]] std::optional<int64_t> rejected_us() const { return rejected_us_; }

  template <class Self, class Archive>
  static void archive(Self& self, Archive& a) {
    ErrorScale::archive(self.noise_, a);
    ErrorScale::archive(self.whiteness_, a);
    a(self.mean_, self.weight_, self.variance_, self.newest_us_, self.used_us_, self.rejected_us_);
  }

 private:
  ErrorScale noise_;                                    ///< of innovations
  ErrorScale whiteness_;                                ///< of their mean
  Eigen::Vector3d mean_ = Eigen::Vector3d::Zero();      ///< sum, decaying, each over its own sigma
  double weight_ = 0.0;                                 ///< how many it is of
  Eigen::Vector3d variance_ = Eigen::Vector3d::Zero();  ///< of the last used one
  std::optional<int64_t> newest_us_, used_us_, rejected_us_;
};

}  // namespace roadfix
