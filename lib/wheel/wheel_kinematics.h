/// Speed and yaw rate of the rear-axle centre from wheel speeds (Ock et al. 2020 (8), (9); MODEL.md (W.3.1) to
/// (W.3.3)).
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "samples/samples.h"

namespace roadfix {

/// Circumferential speed of a wheel from its encoder difference between two readings: radius in m, ticks_per_turn of
/// the encoder (W.3.1). Ock et al. 2020 call r a diameter and omit the interval.
double rim_speed(int64_t ticks, double ticks_per_turn, double radius_m, double dt_s);

/// Which of four wheels define the left and right speed. The mean of front and rear (Ock et al. 2020) suits a
/// skid-steered robot; the front wheels of a car roll along the steering angle and are faster than the axle in a turn.
enum class SideRule { kRearAxle, kMeanOfFrontAndRear };

struct SideSpeeds {
  double left = 0.0;   ///< m/s
  double right = 0.0;  ///< m/s
};

/// Left and right speed from {front left, front right, rear left, rear right}, Ock et al. 2020 (8).
SideSpeeds side_speeds(const std::array<double, 4>& speeds, SideRule rule);

struct WheelMotion {
  double speed = 0.0;                     ///< m/s, of the rear axle's centre; a magnitude where the sign is unknown
  std::optional<double> sides_yaw_rate;   ///< rad/s, from left and right speed, given four speeds and a track width
  std::optional<double> sensor_yaw_rate;  ///< rad/s, of the vehicle's own sensor
};

/// Speed and yaw rate of one sample (W.3.2), (W.3.3), Ock et al. 2020 (9), by vehicle::axle_speed. Direction kReverse
/// negates the speeds and the yaw rate from them; kUnknown gives no yaw rate from the wheels. No value where a speed is
/// no car's, or their number is neither one nor four.
std::optional<WheelMotion> wheel_motion(const WheelSample& sample, std::optional<double> track_width_m, SideRule rule);

}  // namespace roadfix
