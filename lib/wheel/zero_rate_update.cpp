#include "wheel/zero_rate_update.h"

namespace roadfix {

using namespace wheel;  // indices of the error state
namespace {

constexpr double kFirstYawGate = 6.6;  ///< squared sigma, 99 %, first mean of a standstill: beyond it the vehicle turns
constexpr double kBiasGate = 25.0;     ///< squared sigma, all others, of which there may be hundreds

}  // namespace

void ZeroRateUpdate::begin() {
  angle_.setZero();
  time_ = 0.0;
  turning_ = tested_ = false;
}

void ZeroRateUpdate::update(WheelState& state) {
  if (time_ <= 0.0) return;
  const double variance = gyro_noise_ * gyro_noise_ / time_;
  const Eigen::Vector3d difference = angle_ / time_ - state.x.segment<3>(kGyroBias);
  for (int i = 0; i < 3; ++i) {
    const double d = difference(i), S = state.P(kGyroBias + i, kGyroBias + i) + variance;
    const bool no_bias = d * d > (i == 2 && !tested_ ? kFirstYawGate : kBiasGate) * S;
    if (i == 2 && no_bias) turning_ = true;
    if (no_bias || (i == 2 && turning_)) continue;
    WheelVector H = WheelVector::Zero();
    H(kGyroBias + i) = 1.0;
    schmidt_update(state, H, d, variance, {kGyroBias + i});
  }
  tested_ = true;
  angle_.setZero();
  time_ = 0.0;
}

}  // namespace roadfix
