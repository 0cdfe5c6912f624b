/// Standing: velocity and angular rate are zero, and the specific force is gravity's, (N.4.8) to (N.4.10) of MODEL.md.
#pragma once

#include "navigation/filter.h"

namespace roadfix::navigation {

/// In imu axes, where it does not depend on phi.
Measurement<3> zero_velocity(const State& state, double sigma);

/// The mean gyro reading is bias and Earth rate.
Measurement<3> zero_rate(const State& state, const Eigen::Vector3d& mean_gyro, const Eigen::Vector3d& earth_rate,
                         double sigma);

/// Not accelerating by more than sigma: the mean specific force is gravity's reaction and the bias.
Measurement<3> levelling(const State& state, const Eigen::Vector3d& mean_accel, const Eigen::Vector3d& gravity,
                         double sigma);

}  // namespace roadfix::navigation
