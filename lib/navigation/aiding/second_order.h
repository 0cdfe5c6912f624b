/// What linear rows leave out: of the axle's velocity while heading and velocity are unsure, (N.4.15), and of a place
/// whose time is, (N.4.16).
#pragma once

#include "navigation/filter.h"

namespace roadfix::navigation {

/// Mean (m/s) and variance (m2/s2) of the second-order terms of the axle's velocity, vehicle axes, under P.
struct SecondOrder {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Vector3d variance = Eigen::Vector3d::Zero();
};
SecondOrder second_order(const State& state);

/// Takes them into account in a measurement of one axis of that velocity, used every `interval` s, while the heading is
/// unsure. `gain`: of the measurement by the velocity.
void add_second_order(Measurement<1>& m, const Filter& filter, int axis, double gain, double interval);

/// In a position measured at a time that is off, while the car speeds up or turns, or its velocity is unsure: (N.4.16).
void add_second_order(Measurement<3>& position, const State& state, const BodyMotion& motion);

}  // namespace roadfix::navigation
