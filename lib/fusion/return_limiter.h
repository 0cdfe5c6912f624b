/// What the published pose does when the filter's own jumps, as after an outage: small jumps are made up at a bounded
/// rate, large ones only after three good fixes in a row, as a counted reset (MODEL.md, section 9).
#pragma once

#include <cstdint>

#include "fusion/planar.h"

namespace roadfix {

struct ReturnConfig {
  double rate = 2.0;        ///< m/s, at which the published pose returns: from `jump` off within a second
  double turn_rate = 0.05;  ///< rad/s
  double jump = 1.5;        ///< m: residuals above it wait for the fixes and then jump
  int fixes = 3;            ///< in a row
  double ignored = 0.15;    ///< m: corrections below it are passed on as they are
};

template <class Visitor>
void visit(ReturnConfig& c, Visitor& v) {
  v.number("rate_mps", c.rate, 0.01, 1000.0);
  v.number("turn_rate_radps", c.turn_rate, 0.001, 100.0);
  v.number("jump_m", c.jump, 0.0, 1e6);
  v.integer("fixes", c.fixes, 1, 1000);
  v.number("ignored_m", c.ignored, 0.0, 100.0);
}

struct ReturnState {
  Planar residual = Planar::Zero();  ///< published minus filtered
  double height = 0.0;               ///< m, likewise
  int fixes_in_row = 0;
  int resets = 0;
  Planar last_jump = Planar::Zero();  ///< published new minus old
  double last_jump_height = 0.0;      ///< m
};

/// The filter corrected its pose by `correction` (new minus old); `counts`: by a new fix that passed its gate.
void take_fix(ReturnState& s, const ReturnConfig& config, const Planar& correction, bool counts);
/// The same of the height.
void take_height(ReturnState& s, const ReturnConfig& config, double correction);
/// A fix was refused, or none comes any more.
void refuse_fix(ReturnState& s);
/// Time passes: the residual shrinks.
void let_return(ReturnState& s, const ReturnConfig& config, double dt_s);

}  // namespace roadfix
