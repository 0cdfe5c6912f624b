/// Standstill, where the wheels and the IMU say so for half a second, and what it corrects: speed and gyro bias
/// (MODEL.md, section 7).
#pragma once

#include <cstdint>
#include <optional>

#include "inertial/standstill.h"
#include "wheel/wheel_config.h"
#include "wheel/zero_rate_update.h"

namespace roadfix {

class Standstill {
 public:
  explicit Standstill(const WheelConfig& config)
      : standing_speed_(config.tuning.standing_speed),
        noise_{config.sensors.gyro_noise, config.sensors.accel_noise},
        zero_rate_(config.sensors.gyro_noise) {}

  /// A wheel speed, m/s; `trusted` is false while it disagrees with the accelerometer (locked wheels are no
  /// standstill). Zero velocity where a standstill begins (true), a little motion where it ends.
  bool add_speed(WheelState& state, int64_t t_us, double speed, bool trusted);
  /// An IMU sample over dt_s; `rate`: rad/s, with the z axis of the selected source of yaw rate, whose bias is updated.
  void add_imu(WheelState& state, const ImuSample& imu, double dt_s, const Eigen::Vector3d& rate);

  [[nodiscard]] bool standing() const { return standing_; }
  /// The wheels stand and the vehicle turns.
  [[nodiscard]] bool turning() const { return zero_rate_.turning(); }

  template <class Archive>
  void serialise(Archive& a) {
    imu_.serialise(a);
    zero_rate_.serialise(a);
    a(still_since_us_, standing_);
  }

 private:
  void end(WheelState& state);

  double standing_speed_;
  inertial::ImuNoise noise_;
  inertial::StandstillDetector imu_;
  ZeroRateUpdate zero_rate_;
  std::optional<int64_t> still_since_us_;
  bool standing_ = false;
};

}  // namespace roadfix
