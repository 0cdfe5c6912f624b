#include "fusion/return_limiter.h"

#include <algorithm>
#include <cmath>

#include "geometry/so3.h"

namespace roadfix {

void take_fix(ReturnState& s, const ReturnConfig& config, const Planar& correction) {
  ++s.fixes_in_row;
  if (correction.head<2>().norm() > config.ignored || s.residual.head<2>().norm() > config.ignored) {
    s.residual -= correction;
    s.residual.z() = wrap_angle(s.residual.z());
  }
  if (s.residual.head<2>().norm() > config.jump && s.fixes_in_row >= config.fixes) {
    s.last_jump = -s.residual;
    s.residual.setZero();
    ++s.resets;
  }
}

void refuse_fix(ReturnState& s) { s.fixes_in_row = 0; }

void let_return(ReturnState& s, const ReturnConfig& config, double dt_s) {
  const double way = s.residual.head<2>().norm();
  const double kept = way > 0.0 ? std::max(0.0, 1.0 - config.rate * dt_s / way) : 0.0;
  s.residual.head<2>() *= kept;
  const double turn = std::abs(s.residual.z());
  s.residual.z() = std::copysign(std::max(0.0, turn - config.turn_rate * dt_s), s.residual.z());
}

}  // namespace roadfix
