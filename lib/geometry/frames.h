/// Glossary of frames and of the names that carry them. Nothing here but words and two constants; every library means
/// the same by them.
///
/// enu      east, north, up at a WGS84 anchor; fixed to the Earth. The frame of every absolute pose.
/// ecef     Earth-centred, Earth-fixed (WGS84).
/// local    an estimator's own level frame, z up, starting wherever it started.
/// vehicle  ISO 8855: x forward, y left, z up; origin at the rear axle's centre on the ground, or at the imu where a
/// calibration says so. imu      the sensor's axes; x forward, y left, z up up to its mounting angles. camera   x
/// right, y down, z into the scene; origin at the projection centre. antenna  a point (phase centre), no axes.
///
/// T_a_b takes coordinates of b to a, and neighbours match: T_enu_camera = T_enu_imu * T_imu_camera. R_a_b, q_a_b
/// likewise (Hamilton, w first). p_a_b = origin of b seen from a, in the axes of a; other axes are said:
/// omega_enu_imu_in_imu. Yaw is counterclockwise from east; heading, where a sensor or a map says it, is clockwise from
/// north: heading = pi/2 - yaw.
#pragma once

#include <numbers>

namespace roadfix {

inline constexpr double kDegree = std::numbers::pi / 180.0;  ///< radians
inline constexpr double kPi = std::numbers::pi;

}  // namespace roadfix
