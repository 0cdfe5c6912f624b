/// Heading of the vehicle's x axis by two antennas, (N.4.12) of MODEL.md.
#pragma once

#include "navigation/filter.h"

namespace roadfix::navigation {

/// yaw, sigma: rad, counterclockwise from the level frame's x.
Measurement<1> gnss_heading(const State& state, double yaw, double sigma);

}  // namespace roadfix::navigation
