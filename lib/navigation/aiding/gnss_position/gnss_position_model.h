/// GNSS position of the antenna: h, H, R, (N.4.1) and (N.4.2) of MODEL.md.
#pragma once

#include "navigation/filter.h"

namespace roadfix::navigation {

/// z: antenna, m, level frame, valid `ahead` s after the state's epoch (with the state's own latency and offset).
/// cov: m2, of what is white in it; the Gauss-Markov error is a state.
Measurement<3> gnss_position(const State& state, const BodyMotion& motion, const Eigen::Vector3d& z,
                             const Eigen::Matrix3d& cov, double ahead);

}  // namespace roadfix::navigation
