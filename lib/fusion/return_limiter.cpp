#include "fusion/return_limiter.h"

#include <algorithm>
#include <cmath>

#include "geometry/so3.h"

namespace roadfix {

void take_fix(ReturnState& s, const ReturnConfig& config, const Planar& correction, bool counts) {
  if (counts) ++s.fixes_in_row;
  if (correction.head<2>().norm() > config.ignored || s.residual.head<2>().norm() > config.ignored) {
    s.residual -= correction;
    s.residual.z() = wrap_angle(s.residual.z());
  }
  const double away = std::hypot(s.residual.head<2>().norm(), s.height);
  if (away > config.jump && s.fixes_in_row >= config.fixes) {
    s.last_jump = -s.residual;
    s.last_jump_height = -s.height;
    s.residual.setZero();
    s.height = 0.0;
    ++s.resets;
  }
}

void take_height(ReturnState& s, const ReturnConfig& config, double correction) {
  if (std::abs(correction) > config.ignored || std::abs(s.height) > config.ignored) s.height -= correction;
}

void refuse_fix(ReturnState& s) { s.fixes_in_row = 0; }

void let_return(ReturnState& s, const ReturnConfig& config, double dt_s) {
  const double way = s.residual.head<2>().norm();
  const double kept = way > 0.0 ? std::max(0.0, 1.0 - config.rate * dt_s / way) : 0.0;
  s.residual.head<2>() *= kept;
  s.height = std::copysign(std::max(0.0, std::abs(s.height) - config.rate * dt_s), s.height);
  const double turn = std::abs(s.residual.z());
  s.residual.z() = std::copysign(std::max(0.0, turn - config.turn_rate * dt_s), s.residual.z());
}

}  // namespace roadfix
