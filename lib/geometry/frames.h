/// Glossary of frames and of the names that carry them; every library uses them in this sense.
///
/// enu      east, north, up at a WGS84 anchor; fixed to the Earth. The frame of every absolute pose.
/// ecef     Earth-centred, Earth-fixed (WGS84).
/// local    an estimator's own level frame, z up; its origin and yaw are those of its start.
/// vehicle  ISO 8855: x forward, y left, z up; origin at the rear-axle centre on the ground, or at the imu where a
///          calibration says so.
/// imu      the sensor's axes; x forward, y left, z up, up to its mounting angles.
/// camera   x right, y down, z into the scene; origin at the projection centre.
/// antenna  a point (phase centre), no axes.
///
/// T_a_b takes coordinates of b to a, and neighbours match: T_enu_camera = T_enu_imu * T_imu_camera. R_a_b, q_a_b
/// likewise (Hamilton, w first). p_a_b = origin of b seen from a, in axes of a; other axes: omega_enu_imu_in_imu.
/// Yaw is counterclockwise from east; heading is clockwise from north: heading = pi/2 - yaw.
#pragma once

#include <numbers>

namespace roadfix {

inline constexpr double kDegree = std::numbers::pi / 180.0;  ///< radians
inline constexpr double kPi = std::numbers::pi;

}  // namespace roadfix
