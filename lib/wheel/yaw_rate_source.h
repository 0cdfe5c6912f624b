/// Where the yaw rate comes from: the gyro, the vehicle's own sensor, or left and right wheels. The bias about z in the
/// state belongs to the selected source.
#pragma once

#include "wheel/wheel_config.h"
#include "wheel/wheel_kinematics.h"
#include "wheel/wheel_state.h"

namespace roadfix {

class YawRateSource {
 public:
  explicit YawRateSource(const WheelConfig& config) : config_(config) {}

  void add(const WheelMotion& motion);
  /// An IMU sample is there: its gyro, unless the configuration wants another source.
  void select_with_imu(WheelState& state);
  /// No IMU: the wheels, where they have a yaw rate.
  void select_without_imu(WheelState& state);

  [[nodiscard]] bool is_gyro() const { return is_gyro_; }
  /// False: no source has a yaw rate.
  [[nodiscard]] bool known() const { return known_; }
  /// rad/s, of the configured source other than the gyro.
  [[nodiscard]] const std::optional<double>& wheel_rate() const { return wheel_rate_; }
  /// The angular rate `gyro`, rad/s, with the z axis of the selected source.
  [[nodiscard]] Eigen::Vector3d rate(const Eigen::Vector3d& gyro) const;

  template <class Archive>
  void serialise(Archive& a) {
    a(wheel_rate_, is_gyro_, known_);
  }

 private:
  void select(WheelState& state, bool gyro);

  WheelConfig config_;
  std::optional<double> wheel_rate_;
  bool is_gyro_ = true;
  bool known_ = true;
};

}  // namespace roadfix
