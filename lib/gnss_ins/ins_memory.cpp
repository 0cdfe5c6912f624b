#include "gnss_ins/ins_memory.h"

#include <algorithm>
#include <cmath>

namespace roadfix {

namespace {

// Of the spread that the calibration gives: what may be new at each start (assumed; temperature, load, tyre pressure).
constexpr double kTurnOnChange = 0.3;

int state_of(int kept) {
  constexpr int kPlacesKept = InsMemory::kKept - 6;
  return kept < kPlacesKept ? InsMemory::kFirst + kept : kAxle + kept - kPlacesKept;
}

/// What is kept of a state, as differences from nought.
ErrorVector parameters(const NavState& x) {
  NavState zero = x;
  zero.gyro_bias.setZero();
  zero.accel_bias.setZero();
  zero.gyro_scale.setZero();
  zero.accel_scale.setZero();
  zero.wheel_scale = 0.0;
  zero.mounting.setZero();
  zero.p_imu_axle.setZero();
  zero.p_imu_antenna.setZero();
  return local(zero, x);
}

}  // namespace

bool InsMemory::sane() const {
  return value.allFinite() && sigma.allFinite() && sigma.minCoeff() >= 0.0 && std::isfinite(place.latitude) &&
         std::abs(place.latitude) <= 0.5 * M_PI && std::isfinite(place.longitude) && std::isfinite(place.height) &&
         q_enu_imu.coeffs().allFinite() && std::abs(q_enu_imu.norm() - 1.0) < 1e-6 && std::isfinite(place_sigma) &&
         place_sigma >= 0.0 && std::isfinite(heading_sigma) && heading_sigma >= 0.0;
}

void recall(const InsMemory& memory, NavState& x, ErrorVector& std) {
  const ErrorVector calibrated = parameters(x);
  ErrorVector dx = ErrorVector::Zero();
  for (int i = 0; i < InsMemory::kKept; ++i) {
    const int state = state_of(i);
    const double spread = std(state);
    dx(state) = std::clamp(memory.value(i) - calibrated(state), -5.0 * spread, 5.0 * spread);
    std(state) = std::min(spread, std::hypot(memory.sigma(i), kTurnOnChange * spread));
  }
  x = retract(x, dx);
}

InsMemory remembered(const NavState& x, const ErrorMatrix& P) {
  const ErrorVector kept = parameters(x);
  InsMemory memory;
  for (int i = 0; i < InsMemory::kKept; ++i) {
    memory.value(i) = kept(state_of(i));
    memory.sigma(i) = std::sqrt(P(state_of(i), state_of(i)));
  }
  return memory;
}

}  // namespace roadfix
