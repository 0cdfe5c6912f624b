/// A prior pose from outside as a measurement, (N.4.17) and (N.4.18) of MODEL.md.
#pragma once

#include "navigation/filter.h"
#include "samples/samples.h"

namespace roadfix::navigation {

/// `place`: of the imu, level frame; `ahead`: s from the state's epoch to the prior's stamp.
Measurement<3> prior_place(const State& state, const Eigen::Vector3d& place, const Eigen::Matrix3d& cov, double ahead);

/// Of the vehicle's x axis; rad, counterclockwise from the level frame's x.
Measurement<1> prior_heading(const State& state, double yaw, double sigma);

}  // namespace roadfix::navigation
