/// A receiver that claims too much: the factor on its variances, driven so that the normalised innovations average
/// their degrees of freedom, (M.35). Never below one: an honest receiver keeps its sigma.
#pragma once

#include <algorithm>

#include "gnss_ins/measurement.h"

namespace roadfix {

class NoiseScale {
 public:
  /// One until the excess is more than chance.
  [[nodiscard]] double variance_factor() const { return factor_ > kExcess ? factor_ : 1.0; }

  /// A single refused measurement says nothing about the noise (and must leave no trace); several in a row do.
  void learn(const AidingRecord& r) {
    if (r.status == AidingStatus::kAccepted) {
      refused_ = 0;
      adapt(r, kGain);
    } else if (r.status == AidingStatus::kGated && ++refused_ >= kInARow) {
      adapt(r, kFastGain);
    }
  }

  template <class Archive>
  void serialise(Archive& a) {
    a(factor_, refused_);
  }

 private:
  static constexpr double kGain = 0.01;  // a memory of a hundred measurements
  static constexpr double kFastGain = 0.05;
  static constexpr double kMostRatio = 9.0;  // one measurement counts at most as three sigma
  static constexpr double kMost = 1e4;
  static constexpr double kExcess = 1.3;  // three sigma of the factor's own scatter
  static constexpr int kInARow = 8;       // more than a cluster of bad fixes

  void adapt(const AidingRecord& r, double gain) {
    if (r.dof == 0) return;
    factor_ = std::clamp(factor_ * (1.0 + gain * (std::min(r.nis / r.dof, kMostRatio) - 1.0)), 1.0, kMost);
  }

  double factor_ = 1.0;
  int refused_ = 0;
};

}  // namespace roadfix
