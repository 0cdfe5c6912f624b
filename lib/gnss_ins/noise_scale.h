/// A receiver that claims too much: the factor on its variances, driven so that the normalised innovations average
/// their degrees of freedom, (M.35). Never below one: an honest receiver keeps its sigma. After an outage it has to
/// show itself again, (M.37).
#pragma once

#include <algorithm>
#include <cmath>

#include "gnss_ins/measurement.h"

namespace roadfix {

class NoiseScale {
 public:
  /// One until the excess is more than chance.
  [[nodiscard]] double variance_factor() const {
    const double chance = kSigmas * std::sqrt(2.0 / (kAxes * std::max(seen_, 1.0)));
    return factor_ > 1.0 + std::max(chance, kExcess) ? factor_ : 1.0;
  }

  /// What was seen before an outage tells little about the receiver after it.
  void begin_anew() { seen_ = 0.0; }
  /// So few measurements are known that each must speak for itself as well.
  [[nodiscard]] bool doubted() const { return seen_ < kMemory; }

  /// A single refused measurement says nothing about the noise (and must leave no trace); several in a row do.
  void learn(const AidingRecord& r) {
    if (r.status == AidingStatus::kAccepted) {
      refused_ = 0;
      seen_ = std::min(seen_ + 1.0, kMemory);
      adapt(r, 1.0 / seen_);
    } else if (r.status == AidingStatus::kGated && ++refused_ >= kInARow) {
      adapt(r, kFastGain);
    }
  }

  template <class Archive>
  void serialise(Archive& a) {
    a(factor_, refused_, seen_);
  }

 private:
  static constexpr double kMemory = 100.0;  // measurements
  static constexpr double kFastGain = 0.05;
  static constexpr double kMostRatio = 9.0;  // one measurement counts at most as three sigma
  static constexpr double kMost = 1e4;
  static constexpr double kExcess = 0.3;
  static constexpr double kSigmas = 3.0;  // of the factor's own scatter that are chance
  static constexpr double kAxes = 3.0;
  static constexpr int kInARow = 8;  // more than a cluster of bad fixes

  void adapt(const AidingRecord& r, double gain) {
    if (r.dof == 0) return;
    factor_ = std::clamp(factor_ * (1.0 + gain * (std::min(r.nis / r.dof, kMostRatio) - 1.0)), 1.0, kMost);
  }

  double factor_ = 1.0;
  double seen_ = kMemory;  ///< measurements since the last doubt
  int refused_ = 0;
};

}  // namespace roadfix
