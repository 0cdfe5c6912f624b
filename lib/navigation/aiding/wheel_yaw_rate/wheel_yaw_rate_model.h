/// Yaw rate of the car by its own sensor or by the difference of its rear wheels: it measures the gyro's z error,
/// (N.4.14) of MODEL.md.
#pragma once

#include "navigation/filter.h"

namespace roadfix::navigation {

/// yaw_rate: rad/s about the vehicle's z axis, mean over the interval of `mean_gyro` (rad/s, raw imu reading).
Measurement<1> wheel_yaw_rate(const State& state, const Eigen::Vector3d& mean_gyro, double yaw_rate, double sigma);

}  // namespace roadfix::navigation
