/// How the body moves beside its state: means over what measurements need.
#pragma once

#include <Eigen/Dense>

#include "navigation/velocity_lag.h"

namespace roadfix::navigation {

/// What measurements need of the motion at the state's epoch besides the state.
struct BodyMotion {
  Eigen::Vector3d rate = Eigen::Vector3d::Zero();          ///< rad/s against the Earth, imu axes, smoothed
  Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();  ///< m/s2, dv/dt, level axes, smoothed
  VelocityLag lag;
};

}  // namespace roadfix::navigation
