#include "vehicle/speed_rounding.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace roadfix::vehicle {

namespace {

constexpr double kMinSpeedChange = 1e-6;  // m/s, smaller differences count as equal speeds
constexpr int kMinChanges = 20;           // number of speed changes before the step is estimated

}  // namespace

void SpeedRounding::observe(const WheelSample& wheels) {
  const double speed = wheels.speeds[wheels.num_speeds == 4 ? 2 : 0];
  // Speeds in steps differ by at least one of them; others soon differ by almost nothing.
  const double change = std::abs(speed - std::exchange(last_speed_, speed));
  if (!(change >= kMinSpeedChange)) return;
  smallest_change_ = num_changes_ == 0 ? change : std::min(change, smallest_change_);
  num_changes_ = std::min(num_changes_ + 1, kMinChanges);
}

double SpeedRounding::of_many(double dt_s) const {
  if (num_changes_ < kMinChanges) return 0.0;
  return smallest_change_ * std::sqrt(std::max(1.0, kCorrelation / dt_s) / 12.0);
}

}  // namespace roadfix::vehicle
