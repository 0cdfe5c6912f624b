/// Errors of a receiver that stay alike from fix to fix (multipath, a wrong carrier fix, the atmosphere): a filter that
/// takes them for independent averages hundreds of them to a centimetre that is not there, (M.36).
///
/// The correlation of successive errors is seen in the innovations, less what the filter's own error leaves in them. n
/// errors of correlation rho tell as much as n (1 - rho) / (1 + rho) independent ones (Bartlett 1946), so the update
/// takes the variance times the inverse of that. The gate does not: how far off one fix may be is not changed.
#pragma once

#include <algorithm>
#include <cmath>

#include "gnss_ins/lasting_watch.h"
#include "gnss_ins/noise_scale.h"
#include "samples/samples.h"

namespace roadfix {

class ErrorCorrelation {
 public:
  /// What successive fixes are taken for until they have shown themselves.
  void assume(double rho) {
    power_ = 1.0;
    product_ = rho;
    last_us_ = 0;
  }

  /// Factor on the variance of one measurement among many.
  [[nodiscard]] double inflation() const {
    const double rho = correlation();
    return rho > kChance ? (1.0 + rho) / (1.0 - rho) : 1.0;
  }
  [[nodiscard]] double correlation() const { return std::clamp(product_ / power_, 0.0, kMost); }

  /// `variance`: of the measurement alone, per axis, as the gate took it; `inflation`: what the update multiplied it
  /// by.
  template <class Vector>
  void learn(const AidingRecord& r, const Vector& variance, double inflation) {
    if (r.status != AidingStatus::kAccepted || r.dof == 0) return;
    const bool follows = last_us_ != 0 && r.dof == last_dof_ && seconds_between(last_us_, r.t_us) < kNeighbours;
    double product = 0.0, power = 0.0;
    for (int i = 0; i < r.dof; ++i) {
      const auto k = static_cast<size_t>(i);
      const double S = r.innovation_variance[k], R = variance(i), P = std::max(S - R, 0.0);
      const double u = std::clamp(r.innovation[k] / std::sqrt(S), -kMostSigmas, kMostSigmas);
      if (follows) product += (u * last_[k] - left_[k]) / r.dof;
      power += u * u / r.dof;
      last_[k] = u;
      // An update with the very R would leave nothing of itself in the next innovation; one with more leaves error.
      left_[k] = P * R * (inflation - 1.0) / ((P + R * inflation) * S);
    }
    if (follows) {
      product_ += kGain * (product - product_);
      power_ += kGain * (power - power_);
    }
    last_us_ = r.t_us;
    last_dof_ = r.dof;
  }

  template <class Archive>
  void serialise(Archive& a) {
    a(product_, power_, last_us_, last_dof_);
    for (size_t k = 0; k < last_.size(); ++k) a(last_[k], left_[k]);
  }

 private:
  static constexpr double kGain = 1.0 / 30.0;  // a memory of thirty fixes: a bridge is not longer
  static constexpr double kChance = 0.25;      // three sigma of the estimate over that memory and three axes
  static constexpr double kMost = 0.98;
  static constexpr double kMostSigmas = 4.0;
  static constexpr double kNeighbours = 2.5;  // s between fixes that are compared

  double product_ = 0.0, power_ = 1.0;
  int64_t last_us_ = 0;
  int last_dof_ = 0;
  std::array<double, 3> last_{}, left_{};
};

/// What a receiver's positions have shown, apart for each kind of fix: bad ones say nothing of the good ones.
struct PositionQuality {
  NoiseScale noise;
  ErrorCorrelation correlation;
  LastingEvidence lasting;

  template <class Archive>
  void serialise(Archive& a) {
    noise.serialise(a);
    correlation.serialise(a);
    lasting.serialise(a);
  }
};

}  // namespace roadfix
