#include "navigation/initialisation/memory.h"

#include <algorithm>
#include <cmath>

#include "geometry/so3.h"

namespace roadfix::navigation {

namespace {

constexpr double kMostSigmas = 5.0;  // of the calibration's spread, that a remembered value may be off

Memory::Kept parameters(const Mean& x) {
  return local(Mean(), x, Eigen::Vector3d::Zero()).segment<Memory::kKept>(Memory::kFirst);
}

}  // namespace

bool Memory::sane() const {
  return value.allFinite() && sigma.allFinite() && sigma.minCoeff() >= 0.0 && std::isfinite(place.latitude) &&
         std::abs(place.latitude) <= 0.5 * M_PI && std::isfinite(place.longitude) && std::isfinite(place.height) &&
         q_enu_imu.coeffs().allFinite() && std::abs(q_enu_imu.norm() - 1.0) < 1e-6 && std::isfinite(place_sigma) &&
         place_sigma >= 0.0 && std::isfinite(heading_sigma) && heading_sigma >= 0.0;
}

void recall(const Memory& memory, Mean& x, BaseVector& std) {
  const Memory::Kept calibrated = parameters(x);
  BaseVector d = BaseVector::Zero();
  for (int i = 0; i < Memory::kKept; ++i) {
    const int at = Memory::kFirst + i;
    const double spread = std(at);
    d(at) = std::clamp(memory.value(i) - calibrated(i), -kMostSigmas * spread, kMostSigmas * spread);
    std(at) = std::min(spread, std::hypot(memory.sigma(i), inertial::kTurnOnChange * spread));
  }
  x = retract(x, d, x.nav.position);
}

Memory remembered(const State& state) {
  Memory memory;
  memory.value = parameters(state.x);
  memory.sigma = state.P().diagonal().segment<Memory::kKept>(Memory::kFirst).cwiseSqrt();
  return memory;
}

Memory remembered(const State& state, const Geodetic& anchor, bool stands, double heading_std) {
  constexpr double kParkedSigma = 10.0;  // m; a place known worse is not worth keeping
  const EnuAnchor enu(anchor);
  const Mean& x = state.x;
  const Eigen::MatrixXd& P = state.P();
  Memory m = remembered(state);
  m.place = enu.geodetic(x.nav.position);
  m.q_enu_imu = normalized_positive(Eigen::Quaterniond(enu.R_anchor_enu_at(m.place).transpose()) * x.nav.q_level_imu);
  m.place_sigma = std::sqrt(P(kPos, kPos) + P(kPos + 1, kPos + 1));
  m.heading_sigma = std::sqrt(P(kAtt + 2, kAtt + 2));
  m.parked = stands && m.heading_sigma < heading_std && m.place_sigma < kParkedSigma;
  return m;
}

}  // namespace roadfix::navigation
