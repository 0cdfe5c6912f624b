/// Direction of travel in IMU axes under a mounting misalignment, and the acceleration of the rear axle (MODEL.md
/// (W.1.2)).
#pragma once

#include <Eigen/Dense>

namespace roadfix {

/// Unit vector in the direction of travel: `mounting_yaw` to the left of the IMU's x, `mounting_pitch` below it, rad.
Eigen::Vector3d travel_direction(double mounting_yaw, double mounting_pitch);

/// d travel_direction / d (mounting_yaw, mounting_pitch).
Eigen::Matrix<double, 3, 2> travel_direction_jacobian(double mounting_yaw, double mounting_pitch);

/// Acceleration of the rear-axle centre: speed change along the direction of travel, centripetal across it (W.1.2).
Eigen::Vector3d axle_acceleration(double speed, double speed_rate, const Eigen::Vector3d& omega,
                                  const Eigen::Vector3d& direction);

/// Acceleration of a point relative to the body's origin: Euler and centripetal terms; `p` is its lever arm (W.1.3).
Eigen::Vector3d lever_arm_acceleration(const Eigen::Vector3d& p, const Eigen::Vector3d& omega,
                                       const Eigen::Vector3d& omega_rate);

}  // namespace roadfix
