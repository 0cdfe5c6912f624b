/// From a wheel sample to speed and yaw rate of the rear axle's centre, (V.2.1) to (V.2.3) of MODEL.md.
#pragma once

#include "samples/samples.h"

namespace roadfix::vehicle {

/// Facts of the wheels.
struct WheelFacts {
  double speed_noise = 0.05;     ///< m/s, of each speed
  double track_width = 1.5;      ///< m, between the rear wheels
  double yaw_rate_noise = 0.01;  ///< rad/s, of the car's own yaw rate
  double yaw_rate_bias = 0.003;  ///< rad/s, sigma of its offset: cars null it where they stand (assumed)
};

struct AxleSpeed {
  double speed = 0.0;  ///< m/s; a magnitude where the direction is unknown
  double sigma = 0.0;  ///< m/s
  WheelDirection direction = WheelDirection::kSigned;
  std::optional<double> yaw_rate;        ///< rad/s, z up, of the car's own sensor
  std::optional<double> sides_yaw_rate;  ///< rad/s, of the rear wheels' difference; turns its sign with the direction
  double sides_sigma = 0.0;              ///< rad/s
};

/// Nothing where a speed is no number or no car's (above 100 m/s).
std::optional<AxleSpeed> axle_speed(const WheelSample& wheels, const WheelFacts& facts);

/// The signed speed, where the sample's direction or a predicted speed gives the sign; nothing where neither does.
/// `predicted` counts above kSignKnown.
inline constexpr double kSignKnown = 0.3;  ///< m/s
std::optional<double> signed_speed(const AxleSpeed& s, double predicted);

}  // namespace roadfix::vehicle
