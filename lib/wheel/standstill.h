/// Standstill, where wheel speed and rate say so for a minimum time, and what it corrects: speed and gyro bias
/// (MODEL.md, section 7).
#pragma once

#include <cstdint>
#include <optional>

#include "wheel/wheel_config.h"
#include "wheel/zero_rate_update.h"

namespace roadfix {

class Standstill {
 public:
  explicit Standstill(const WheelConfig& config) : tuning_(config.tuning), zero_rate_(config.sensors.gyro_noise) {}

  /// A wheel speed, m/s; `trusted` is false while it disagrees with the accelerometer (locked wheels are no
  /// standstill). Zero velocity where a standstill begins (true), a little motion where it ends.
  bool add_speed(WheelState& state, int64_t t_us, double speed, bool trusted);
  /// An angular rate over dt_s, rad/s: `gyro` of the sensor; `rate` with the z axis of the selected source of yaw rate,
  /// whose bias is updated.
  void add_rate(WheelState& state, double dt_s, const Eigen::Vector3d& gyro, const Eigen::Vector3d& rate);
  /// The rate before the start.
  void set_rate(const Eigen::Vector3d& gyro) { filtered_gyro_ = gyro; }

  [[nodiscard]] bool standing() const { return standing_; }
  /// The wheels stand and the vehicle turns.
  [[nodiscard]] bool turning() const { return zero_rate_.turning(); }

  template <class Archive>
  void serialise(Archive& a) {
    a(still_since_us_, filtered_gyro_, reference_gyro_, standing_);
    zero_rate_.serialise(a);
  }

 private:
  void end();

  WheelTuning tuning_;
  ZeroRateUpdate zero_rate_;
  std::optional<int64_t> still_since_us_;
  Eigen::Vector3d filtered_gyro_ = Eigen::Vector3d::Zero();   ///< rad/s, smoothed over kGyroSmoothing
  Eigen::Vector3d reference_gyro_ = Eigen::Vector3d::Zero();  ///< rad/s, filtered_gyro_ at the start of the still
                                                              ///< interval
  bool standing_ = false;
};

}  // namespace roadfix
