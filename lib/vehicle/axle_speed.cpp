#include "vehicle/axle_speed.h"

#include <cmath>

namespace roadfix::vehicle {

namespace {

constexpr double kMaxSpeed = 100.0;  // m/s

}  // namespace

std::optional<AxleSpeed> axle_speed(const WheelSample& wheels, const WheelFacts& facts) {
  for (int i = 0; i < wheels.num_speeds; ++i) {
    const double v = wheels.speeds[static_cast<size_t>(i)];
    if (!std::isfinite(v) || std::abs(v) > kMaxSpeed) return std::nullopt;
  }
  AxleSpeed out;
  out.direction = wheels.direction;
  if (wheels.yaw_rate && std::isfinite(*wheels.yaw_rate)) out.yaw_rate = wheels.yaw_rate;
  if (wheels.num_speeds == 4) {
    // The rear wheels do not steer: their mean is the centre's speed, with half the variance of one.
    const double left = wheels.speeds[2], right = wheels.speeds[3];
    out.speed = 0.5 * (left + right);
    out.sigma = facts.speed_noise / std::sqrt(2.0);
    out.sides_yaw_rate = (right - left) / facts.track_width;
    out.sides_sigma = std::sqrt(2.0) * facts.speed_noise / facts.track_width;
  } else {
    out.speed = wheels.speeds[0];
    out.sigma = facts.speed_noise;
  }
  return out;
}

std::optional<double> signed_speed(const AxleSpeed& s, double predicted) {
  switch (s.direction) {
    case WheelDirection::kSigned:
      return s.speed;
    case WheelDirection::kForward:
      return std::abs(s.speed);
    case WheelDirection::kReverse:
      return -std::abs(s.speed);
    case WheelDirection::kUnknown:
      break;
  }
  if (std::abs(s.speed) < kSignKnown || std::abs(predicted) < kSignKnown) return std::nullopt;
  return std::copysign(s.speed, predicted);
}

}  // namespace roadfix::vehicle
