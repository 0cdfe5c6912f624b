/// Standstill detection: wheel speed below a threshold and a constant yaw rate for a minimum time (MODEL.md, section
/// 7).
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <optional>

namespace roadfix {

struct StandstillLimits {
  double speed = 0.0;  ///< m/s
  double rate = 0.0;   ///< rad/s, change of the rate since the start of the interval, so that the gyro bias cancels
  double after = 0.0;  ///< s, minimum duration
};

struct StandstillState {
  std::optional<int64_t> still_since_us;
  Eigen::Vector3d filtered_gyro = Eigen::Vector3d::Zero();   ///< rad/s, smoothed over kGyroSmoothing
  Eigen::Vector3d reference_gyro = Eigen::Vector3d::Zero();  ///< rad/s, filtered_gyro at the start of the still
                                                             ///< interval
  bool standing = false;
};

inline constexpr double kGyroSmoothing = 0.2;  ///< s, longer than engine vibration, shorter than a pull-away

/// Adds a wheel speed; `trusted` is false while it disagrees with the accelerometer (locked wheels are no standstill).
void add_speed(StandstillState& s, const StandstillLimits& limits, int64_t t_us, double speed, bool trusted);
void add_gyro(StandstillState& s, const StandstillLimits& limits, double dt_s, const Eigen::Vector3d& gyro);

}  // namespace roadfix
