#include "wheel/wheel_kinematics.h"

#include "geometry/frames.h"
#include "vehicle/axle_speed.h"

namespace roadfix {

double rim_speed(int64_t ticks, double ticks_per_turn, double radius_m, double dt_s) {
  return 2.0 * kPi * radius_m * static_cast<double>(ticks) / (ticks_per_turn * dt_s);
}

SideSpeeds side_speeds(const std::array<double, 4>& speeds, SideRule rule) {
  if (rule == SideRule::kRearAxle) return {speeds[2], speeds[3]};
  return {0.5 * (speeds[0] + speeds[2]), 0.5 * (speeds[1] + speeds[3])};
}

std::optional<WheelMotion> wheel_motion(const WheelSample& sample, std::optional<double> track_width_m, SideRule rule) {
  if (sample.num_speeds != 1 && sample.num_speeds != 4) return std::nullopt;
  WheelSample by_sides = sample;
  if (sample.num_speeds == 4) {
    const SideSpeeds sides = side_speeds(sample.speeds, rule);
    by_sides.speeds[2] = sides.left;
    by_sides.speeds[3] = sides.right;
  }
  vehicle::WheelFacts facts;
  facts.track_width = track_width_m.value_or(facts.track_width);
  const std::optional<vehicle::AxleSpeed> axle = vehicle::axle_speed(by_sides, facts);
  if (!axle) return std::nullopt;
  const double sign = sample.direction == WheelDirection::kReverse ? -1.0 : 1.0;
  WheelMotion motion{sign * axle->speed, std::nullopt, axle->yaw_rate};
  if (track_width_m && axle->sides_yaw_rate && sample.direction != WheelDirection::kUnknown)
    motion.sides_yaw_rate = sign * *axle->sides_yaw_rate;
  return motion;
}

}  // namespace roadfix
