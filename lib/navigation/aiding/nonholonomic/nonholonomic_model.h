/// Non-holonomic constraint: no velocity up at the rear axle, and sideways what its tyres slip, (N.4.7) of MODEL.md.
#pragma once

#include "navigation/filter.h"

namespace roadfix::navigation {

/// axis 1: lateral, 2: vertical.
Measurement<1> nonholonomic(const State& state, const BodyMotion& motion, int axis, double sigma);

}  // namespace roadfix::navigation
