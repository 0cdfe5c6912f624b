/// GNSS velocity of the antenna: h, H, R, (N.4.4) of MODEL.md.
#pragma once

#include "navigation/filter.h"

namespace roadfix::navigation {

/// z: m/s, level axes, valid `ahead` s after the state's epoch; cov: (m/s)^2, of what is white in it.
Measurement<3> gnss_velocity(const State& state, const BodyMotion& motion, const Eigen::Vector3d& z,
                             const Eigen::Matrix3d& cov, double ahead);

}  // namespace roadfix::navigation
