#include "wheel/wheel_kinematics.h"

#include "geometry/frames.h"

namespace roadfix {

double rim_speed(int64_t ticks, double ticks_per_turn, double radius_m, double dt_s) {
  return 2.0 * kPi * radius_m * static_cast<double>(ticks) / (ticks_per_turn * dt_s);
}

SideSpeeds side_speeds(const std::array<double, 4>& speeds, SideRule rule) {
  if (rule == SideRule::kRearAxle) return {speeds[2], speeds[3]};
  return {0.5 * (speeds[0] + speeds[2]), 0.5 * (speeds[1] + speeds[3])};
}

WheelMotion wheel_motion(const WheelSample& sample, std::optional<double> track_width_m, SideRule rule) {
  const double sign = sample.direction == WheelDirection::kReverse ? -1.0 : 1.0;
  WheelMotion motion;
  motion.sensor_yaw_rate = sample.yaw_rate;
  if (sample.num_speeds != 4) {
    motion.speed = sign * sample.speeds[0];
    return motion;
  }
  const SideSpeeds sides = side_speeds(sample.speeds, rule);
  motion.speed = sign * 0.5 * (sides.right + sides.left);
  if (track_width_m && sample.direction != WheelDirection::kUnknown)
    motion.sides_yaw_rate = sign * (sides.right - sides.left) / *track_width_m;
  return motion;
}

}  // namespace roadfix
