/// Which way the car goes in the imu's axes, which may sit askew on it, and what its axle feels there (MODEL.md (M.2)).
#pragma once

#include <Eigen/Dense>

namespace roadfix {

/// Unit vector of travel: `side` rad to the left of the imu's x, `climb` rad below it.
Eigen::Vector3d travel_direction(double side, double climb);

/// d travel_direction / d (side, climb).
Eigen::Matrix<double, 3, 2> travel_direction_jacobian(double side, double climb);

/// Acceleration of the rear axle's centre: speed change along the direction of travel, centripetal across it (M.2).
Eigen::Vector3d wheel_acceleration(double speed, double speed_rate, const Eigen::Vector3d& omega,
                                   const Eigen::Vector3d& direction);

/// By how much a point at `p` from another one on a turning body accelerates more than that one (M.2a).
Eigen::Vector3d lever_acceleration(const Eigen::Vector3d& p, const Eigen::Vector3d& omega,
                                   const Eigen::Vector3d& omega_rate);

}  // namespace roadfix
