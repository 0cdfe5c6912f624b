#include "wheel/speed_update.h"

#include <algorithm>
#include <cmath>

namespace roadfix {

using namespace wheel;  // indices of the error state
namespace {

/// Derivative of the wheel speed by the state.
WheelVector speed_jacobian(const WheelVector& x) {
  const double scale = 1.0 + x(kWheelScale);
  WheelVector H = WheelVector::Zero();
  H(kSpeed) = 1.0 / scale;
  H(kWheelScale) = -x(kSpeed) / (scale * scale);
  return H;
}

/// Gain of the speed as if the wheel scale were known (W.6.2).
WheelVector speed_gain(const WheelCovariance& P, const WheelVector& H, double variance) {
  const double by_scale =
      P(kSpeed, kWheelScale) * P(kSpeed, kWheelScale) / std::max(P(kWheelScale, kWheelScale), 1e-12);
  const double known_scale = std::max(P(kSpeed, kSpeed) - by_scale, 0.0);
  WheelVector K = WheelVector::Zero();
  K(kSpeed) = known_scale * H(kSpeed) / (H(kSpeed) * known_scale * H(kSpeed) + variance);
  return K;
}

}  // namespace

double WheelSpeedUpdate::signed_speed(const WheelSpeed& z) const {
  return (z.magnitude_only && direction_.sign < 0 ? -1.0 : 1.0) * z.value;
}

/// Speed with the sign of the more likely direction; no value while undecided.
std::optional<double> WheelSpeedUpdate::resolve_sign(const WheelSpeed& z, double predicted, double variance) {
  const WheelTuning& t = config_.tuning;
  if (z.value < t.standing_speed) return std::clamp(predicted, -z.value, z.value);
  update_direction(direction_, {t.direction_evidence, t.direction_timeout}, z.t_us, z.value, predicted, variance);
  if (direction_.sign == 0) return std::nullopt;
  return direction_.sign * z.value;
}

bool WheelSpeedUpdate::reject_slip(WheelState& state, int64_t t_us, double innovation, double S) {
  const WheelTuning& t = config_.tuning;
  if (innovation * innovation > t.slip_gate * t.slip_gate * S) {
    if (!slip_since_us_) slip_since_us_ = t_us;
    if (seconds_between(*slip_since_us_, t_us) < t.slip_timeout) return true;
    state.P(kSpeed, kSpeed) += innovation * innovation;  // too long for slip: accept the wheel speed again
  }
  slip_since_us_.reset();
  return false;
}

WheelInputStatus WheelSpeedUpdate::update(WheelState& state, const WheelSpeed& z, double acceleration, double dt_s) {
  const double variance = std::pow(std::hypot(config_.sensors.wheel_noise, rounding_.of_many(dt_s)), 2);
  const WheelVector H = speed_jacobian(state.x);
  // (W.6.3): the state may be slightly older.
  const double predicted =
      (state.x(kSpeed) + acceleration * seconds_between(state.t_us, z.t_us)) / (1.0 + state.x(kWheelScale));
  const double S = H.dot(state.P * H) + variance;
  std::optional<double> speed = z.value;
  if (z.magnitude_only) {
    speed = resolve_sign(z, predicted, S);
    if (!speed) return WheelInputStatus::kNoDirection;
  } else {
    forget_direction();
  }
  const double innovation = *speed - predicted;
  if (reject_slip(state, z.t_us, innovation, S)) return WheelInputStatus::kSlip;
  update_by_gain(state, H, speed_gain(state.P, H, variance), innovation, variance);
  return WheelInputStatus::kUsed;
}

}  // namespace roadfix
