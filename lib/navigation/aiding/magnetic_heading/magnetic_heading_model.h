/// The horizontal magnetic field points to magnetic north, (N.4.13) of MODEL.md.
#pragma once

#include "navigation/filter.h"

namespace roadfix::navigation {

/// field: any unit, vehicle axes, distortions taken out; declination: rad, east positive.
Measurement<1> magnetic_heading(const State& state, const Eigen::Vector3d& field, double declination, double sigma);

}  // namespace roadfix::navigation
