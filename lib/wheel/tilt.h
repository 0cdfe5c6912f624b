/// Roll and pitch by a complementary filter: gyro at high, direction of gravity at low frequencies (Ock et al. 2020,
/// equations 1 to 4, corrected; MODEL.md (W.1.1) to (W.1.7)).
///
/// Axes: vehicle, x forward, y left, z up; roll and pitch as in geometry/euler.h.
#pragma once

#include <Eigen/Dense>

namespace roadfix {

struct Tilt {
  double roll = 0.0;   ///< rad, right side down
  double pitch = 0.0;  ///< rad, nose down
};

/// Roll and pitch from the specific force, in vehicle axes, of a body that does not accelerate (W.1.4).
Tilt tilt_of_gravity(const Eigen::Vector3d& specific_force);

/// d (roll, pitch) / d specific_force, (W.1.5).
Eigen::Matrix<double, 2, 3> tilt_of_gravity_jacobian(const Eigen::Vector3d& specific_force);

/// Ock et al. 2020 (1), (2) as printed: A_x gives "roll", A_y gives "pitch"; each is the angle of one axis to the
/// horizontal.
Tilt printed_tilt(const Eigen::Vector3d& specific_force);

/// Euler angle rates (roll, pitch, yaw) of a body with angular rate omega in vehicle axes (W.1.1).
Eigen::Vector3d euler_rates(const Tilt& tilt, const Eigen::Vector3d& omega);

/// d euler_rates / d (roll, pitch), and d euler_rates / d omega.
Eigen::Matrix<double, 3, 2> euler_rates_by_tilt(const Tilt& tilt, const Eigen::Vector3d& omega);
Eigen::Matrix3d euler_rates_by_omega(const Tilt& tilt);

/// Weight of the accelerometer's angle in one step, 1 - alpha of Ock et al. 2020 (3): dt / (time_constant + dt); the
/// corner frequency does not depend on the sample rate.
double accelerometer_share(double dt_s, double time_constant_s);

/// predicted + share * (measured - predicted), roll wrapped; Ock et al. 2020 (3), (4) and (W.1.6).
Tilt blend(const Tilt& predicted, const Tilt& measured, double share);

}  // namespace roadfix
