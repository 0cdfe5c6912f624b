/// A road is level but for its slope: roll and pitch of a car are small. With the process noise of the tilt it makes a
/// stationary process of them, (N.2.9) of MODEL.md. For a car without an imu, where nothing else measures what is up.
#pragma once

#include "navigation/measurement.h"

namespace roadfix::navigation {

/// The level frame's z axis in imu axes has no x and y; `sigma` in rad.
Measurement<2> road_level(const State& state, double sigma);

}  // namespace roadfix::navigation
