/// Pose and velocity of the IMU with their covariance from the state of the axle (MODEL.md, section 10).
#pragma once

#include "samples/samples.h"
#include "wheel/wheel_config.h"
#include "wheel/wheel_state.h"

namespace roadfix {

/// `angular_rate`: rad/s, IMU axes, without bias. The validity is left open.
Odometry wheel_output(const WheelState& state, const WheelConfig& config, const Eigen::Vector3d& angular_rate);

}  // namespace roadfix
