/// Update of the speed by a wheel speed, with the direction of unsigned speeds and the rejection of slip (MODEL.md,
/// sections 6 and 8).
#pragma once

#include <cmath>

#include "vehicle/speed_rounding.h"
#include "wheel/direction.h"
#include "wheel/wheel_config.h"
#include "wheel/wheel_report.h"
#include "wheel/wheel_state.h"

namespace roadfix {

/// Speed of the rear axle's centre from one wheel sample.
struct WheelSpeed {
  int64_t t_us = 0;
  double value = 0.0;           ///< m/s
  bool magnitude_only = false;  ///< its sign is unknown
};

class WheelSpeedUpdate {
 public:
  explicit WheelSpeedUpdate(const WheelConfig& config) : config_(config) {}

  /// Every received sample, before anything else is done with it.
  void observe(const WheelSample& wheels) { rounding_.observe(wheels); }
  /// Updates the speed alone. `acceleration`: m/s2, of the state, along the direction of travel; `dt_s`: since the
  /// sample before.
  WheelInputStatus update(WheelState& state, const WheelSpeed& z, double acceleration, double dt_s);
  /// Before the start.
  void await_direction(const WheelSpeed& z) {
    if (z.magnitude_only && !direction_.undecided_since_us) direction_.undecided_since_us = z.t_us;
  }
  /// A vehicle that stands may drive off in either direction.
  void forget_direction() { direction_ = DirectionState{}; }

  /// The direction is neither measured nor decided.
  [[nodiscard]] bool sign_unknown(const WheelSpeed& z) const { return z.magnitude_only && direction_.sign == 0; }
  /// m/s; forward where the sign is unknown.
  [[nodiscard]] double signed_speed(const WheelSpeed& z) const;
  [[nodiscard]] bool slipping() const { return slip_since_us_.has_value(); }
  [[nodiscard]] const DirectionState& direction() const { return direction_; }
  /// Standard deviation of one sample alone, m/s.
  [[nodiscard]] double sigma_of_one() const { return std::hypot(config_.sensors.wheel_noise, rounding_.of_one()); }

  template <class Archive>
  void serialise(Archive& a) {
    rounding_.serialise(a);
    a(direction_.sign, direction_.assumed, direction_.undecided_since_us, slip_since_us_);
  }

 private:
  [[nodiscard]] std::optional<double> resolve_sign(const WheelSpeed& z, double predicted, double variance);
  /// Whether an innovation of the variance S is slip; where it lasts too long for slip, the speed's variance grows.
  [[nodiscard]] bool reject_slip(WheelState& state, int64_t t_us, double innovation, double S);

  WheelConfig config_;
  vehicle::SpeedRounding rounding_;
  DirectionState direction_;
  std::optional<int64_t> slip_since_us_;
};

}  // namespace roadfix
