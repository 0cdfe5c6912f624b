#include "wheel/speed_noise.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace roadfix {
namespace {

constexpr double kMinSpeedChange = 1e-6;      ///< m/s, smaller differences count as equal speeds
constexpr int kMinChanges = 20;               ///< number of speed changes before the resolution is estimated
constexpr double kRoundingCorrelation = 1.0;  ///< s, correlation time of the rounding error

}  // namespace

void WheelSpeedNoise::observe(double speed) {
  // Quantised speeds, as many buses carry them, differ by at least one step; others soon differ by almost nothing.
  const double change = std::abs(speed - std::exchange(last_speed_, speed));
  if (change < kMinSpeedChange) return;
  smallest_change_ = num_changes_ == 0 ? change : std::min(change, smallest_change_);
  num_changes_ = std::min(num_changes_ + 1, kMinChanges);
}

double WheelSpeedNoise::of_one() const { return of_many(kRoundingCorrelation); }

double WheelSpeedNoise::of_many(double dt_s) const {
  if (num_changes_ < kMinChanges) return sigma_;
  return std::hypot(sigma_, smallest_change_ * std::sqrt(std::max(1.0, kRoundingCorrelation / dt_s) / 12.0));
}

}  // namespace roadfix
