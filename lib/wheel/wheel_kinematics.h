/// From wheels to the speed and the yaw rate of the rear axle's centre (paper B (8), (9); MODEL.md (M.11) to (M.13)).
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "samples/samples.h"

namespace roadfix {

/// Speed of a wheel's rim from its turn between two readings: radius in m, ticks_per_turn of the encoder (M.11). Paper
/// B calls r a diameter and leaves the interval out; with wheel angles it is the radius, and the difference is a rate.
double rim_speed(int64_t ticks, double ticks_per_turn, double radius_m, double dt_s);

/// Which of four wheels make a side. The paper's mean of front and rear fits a skid-steered robot; a car's front wheels
/// point along the steering angle and run faster than the axle in a turn.
enum class SideRule { kRearAxle, kMeanOfFrontAndRear };

struct SideSpeeds {
  double left = 0.0;   ///< m/s
  double right = 0.0;  ///< m/s
};

/// Left and right side of {front left, front right, rear left, rear right}, paper B (8).
SideSpeeds side_speeds(const std::array<double, 4>& speeds, SideRule rule);

struct WheelMotion {
  double speed = 0.0;                     ///< m/s, of the rear axle's centre; a magnitude where the sign is unknown
  std::optional<double> sides_yaw_rate;   ///< rad/s, from the sides, where there are four speeds and a track width
  std::optional<double> sensor_yaw_rate;  ///< rad/s, of the car's own sensor
};

/// Speed and yaw rate of one sample (M.12), (M.13), paper B (9). With direction kReverse the magnitudes change sign
/// together, the yaw rate of the sides with them; with kUnknown the yaw rate of the sides is withheld.
WheelMotion wheel_motion(const WheelSample& sample, std::optional<double> track_width_m, SideRule rule);

}  // namespace roadfix
