/// Speed of the rear axle's centre by the wheels: h, H, R, (N.4.6) of MODEL.md.
#pragma once

#include "navigation/filter.h"

namespace roadfix::navigation {

/// speed: m/s, signed, valid `ahead` s after the state's epoch.
Measurement<1> wheel_speed(const State& state, const BodyMotion& motion, double speed, double sigma, double ahead);

}  // namespace roadfix::navigation
