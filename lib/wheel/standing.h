/// Does the car stand? Wheels below a speed and a yaw that does not change, for a while (MODEL.md, section 7).
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <optional>

namespace roadfix {

struct StandingLimits {
  double speed = 0.0;  ///< m/s
  double rate = 0.0;   ///< rad/s, of change against the beginning: a gyro's bias is no motion
  double after = 0.0;  ///< s
};

struct StandingState {
  std::optional<int64_t> quiet_since_us;
  Eigen::Vector3d slow_gyro = Eigen::Vector3d::Zero();   ///< rad/s, smoothed over kGyroSmoothing
  Eigen::Vector3d quiet_gyro = Eigen::Vector3d::Zero();  ///< rad/s, slow_gyro when it became quiet
  bool standing = false;
};

inline constexpr double kGyroSmoothing = 0.2;  ///< s, longer than an engine's vibration, shorter than a start

/// A wheel sample; `trusted` is false while it disagrees with the accelerometer (locked wheels are no standstill).
void add_speed(StandingState& s, const StandingLimits& limits, int64_t t_us, double speed, bool trusted);
void add_gyro(StandingState& s, const StandingLimits& limits, double dt_s, const Eigen::Vector3d& gyro);

}  // namespace roadfix
