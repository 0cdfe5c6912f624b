/// Velocity of the rear axle's centre in vehicle axes, which wheels measure (x) and the non-holonomic constraint sets
/// to zero (y, z), (V.1.1) and (V.1.2) of MODEL.md.
#pragma once

#include <Eigen/Dense>

namespace roadfix::vehicle {

/// R_imu_vehicle = Exp(0, pitch, yaw). The roll of the mounting does not show in a velocity.
Eigen::Matrix3d R_imu_vehicle(const Eigen::Vector2d& mounting);

struct AxleVelocity {
  Eigen::Vector3d value;                    ///< m/s, vehicle axes
  Eigen::Matrix3d by_velocity;              ///< by the imu's velocity, imu axes
  Eigen::Matrix3d by_rate;                  ///< by the angular rate, imu axes
  Eigen::Matrix<double, 3, 2> by_mounting;  ///< by pitch and yaw of the mounting
  Eigen::Matrix3d by_axle;                  ///< by the axle's place, imu axes
};

/// velocity, rate: of the imu, imu axes, m/s and rad/s; p_imu_axle: m, imu axes.
AxleVelocity axle_velocity(const Eigen::Vector3d& velocity, const Eigen::Vector3d& rate,
                           const Eigen::Vector2d& mounting, const Eigen::Vector3d& p_imu_axle);

}  // namespace roadfix::vehicle
