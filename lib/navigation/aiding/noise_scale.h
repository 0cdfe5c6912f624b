/// Adaptive scale of a sensor's claimed variances, (N.5.3): driven so that normalised innovations average their degrees
/// of freedom. Never below one: an honest sensor keeps its sigma.
#pragma once

#include <algorithm>
#include <cmath>

#include "navigation/measurement.h"
#include "statistics/chance.h"

namespace roadfix::navigation {

class NoiseScale {
 public:
  /// One until the excess is more than chance.
  [[nodiscard]] double variance_factor() const {
    const double chance = kChance * std::sqrt(2.0 / (kAxes * std::max(seen_, 1.0)));
    return factor_ > 1.0 + std::max(chance, kExcess) ? factor_ : 1.0;
  }

  /// An accepted measurement, or one of several rejected in a row that do not agree with each other. A single rejected
  /// one carries no information about the noise, and must leave no trace.
  void learn(const AidingRecord& r) {
    if (r.dof == 0) return;
    seen_ = std::min(seen_ + 1.0, kMemory);
    const double gain = std::max(1.0 / kMemory, 1.0 / (seen_ + kPrior));
    factor_ = std::clamp(factor_ * (1.0 + gain * (std::min(r.nis / r.dof, kChance * kChance) - 1.0)), 1.0, kMost);
  }

  template <class Archive>
  void serialise(Archive& a) {
    a(factor_, seen_);
  }

 private:
  static constexpr double kMemory = 100.0;  // measurements
  static constexpr double kPrior = 10.0;    // measurements that the claim counts for
  static constexpr double kMost = 1e4;
  static constexpr double kExcess = 0.3;
  static constexpr double kAxes = 3.0;

  double factor_ = 1.0;
  double seen_ = 0.0;
};

}  // namespace roadfix::navigation
