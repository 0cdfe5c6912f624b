/// Bearing of a direction that is fixed in the vehicle, with its Jacobian, (N.4.11).
#pragma once

#include <cmath>

#include "geometry/so3.h"
#include "navigation/filter.h"
#include "vehicle/axle_velocity.h"

namespace roadfix::navigation {

/// Residual of `yaw` (rad, counterclockwise from the level frame's x) against that of `in_vehicle` (unit vector).
inline Measurement<1> bearing(const State& state, const Eigen::Vector3d& in_vehicle, double yaw, double sigma) {
  const Mean& x = state.x;
  const Eigen::Matrix3d R_level_vehicle = x.R() * vehicle::R_imu_vehicle(x.mounting);
  const Eigen::Vector3d d = R_level_vehicle * in_vehicle;
  const Eigen::RowVector3d slope = Eigen::RowVector3d(-d.y(), d.x(), 0.0) / (d.x() * d.x() + d.y() * d.y());
  const Eigen::Matrix3d J = right_jacobian(Eigen::Vector3d(0.0, x.mounting.x(), x.mounting.y()));
  const Eigen::Matrix<double, 3, 2> by_mounting = (-R_level_vehicle * skew(in_vehicle) * J).rightCols<2>();
  Measurement<1> m;
  m.residual(0) = wrap_angle(yaw - std::atan2(d.y(), d.x()));
  m.H.block<1, 3>(0, kAtt) = -slope * skew(d);
  m.H.block<1, 2>(0, kMounting) = slope * by_mounting;
  m.R(0, 0) = sigma * sigma;
  return m;
}

}  // namespace roadfix::navigation
