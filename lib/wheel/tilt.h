/// Roll and pitch by a complementary filter: the gyro for the short term, the direction of gravity for the long one
/// (paper B (1) to (4), corrected; MODEL.md (M.1) to (M.6)).
///
/// Axes: vehicle, x forward, y left, z up; roll and pitch as in geometry/euler.h.
#pragma once

#include <Eigen/Dense>

namespace roadfix {

struct Tilt {
  double roll = 0.0;   ///< rad, right side down
  double pitch = 0.0;  ///< rad, nose down
};

/// Roll and pitch of a body that feels only gravity's reaction, specific force in vehicle axes (M.3).
Tilt tilt_of_gravity(const Eigen::Vector3d& specific_force);

/// d (roll, pitch) / d specific_force, (M.4).
Eigen::Matrix<double, 2, 3> tilt_of_gravity_jacobian(const Eigen::Vector3d& specific_force);

/// Paper B (1), (2) as printed: A_x gives "roll" and A_y gives "pitch", each the angle of one axis to the horizontal.
Tilt printed_tilt(const Eigen::Vector3d& specific_force);

/// Rates of (roll, pitch, yaw) for a body turning with omega, in vehicle axes (M.1).
Eigen::Vector3d euler_rates(const Tilt& tilt, const Eigen::Vector3d& omega);

/// d euler_rates / d (roll, pitch), and d euler_rates / d omega.
Eigen::Matrix<double, 3, 2> euler_rates_by_tilt(const Tilt& tilt, const Eigen::Vector3d& omega);
Eigen::Matrix3d euler_rates_by_omega(const Tilt& tilt);

/// Share of the accelerometer's angle in one step, 1 - alpha of paper B (3): dt / (time_constant + dt), so that the
/// filter's corner does not move with the sample rate.
double accelerometer_share(double dt_s, double time_constant_s);

/// predicted + share * (measured - predicted), roll on the circle; paper B (3), (4) and (M.5).
Tilt blend(const Tilt& predicted, const Tilt& measured, double share);

}  // namespace roadfix
