/// Gyro bias from the mean rate of a vehicle that stands; finds a vehicle that turns while its wheels stand (MODEL.md,
/// section 7).
#pragma once

#include "wheel/wheel_state.h"

namespace roadfix {

class ZeroRateUpdate {
 public:
  /// `gyro_noise`: rad/s per sqrt(Hz).
  explicit ZeroRateUpdate(double gyro_noise) : gyro_noise_(gyro_noise) {}

  /// A standstill begins.
  void begin();
  /// A rate (rad/s, raw) of dt_s at standstill.
  void add(double dt_s, const Eigen::Vector3d& gyro) {
    angle_ += dt_s * gyro;
    time_ += dt_s;
  }
  /// Updates the bias by the mean since the last update.
  void update(WheelState& state);
  /// The wheels stand, but the rate about z exceeds any plausible gyro bias (turntable, ferry).
  [[nodiscard]] bool turning() const { return turning_; }

  template <class Archive>
  void serialise(Archive& a) {
    a(turning_, tested_, angle_, time_);
  }

 private:
  double gyro_noise_;
  bool turning_ = false;
  bool tested_ = false;                              ///< by the first mean of this standstill
  Eigen::Vector3d angle_ = Eigen::Vector3d::Zero();  ///< rad, integrated
  double time_ = 0.0;                                ///< s
};

}  // namespace roadfix
