#include "wheel/direction.h"

#include "samples/samples.h"
#include "vehicle/axle_speed.h"

namespace roadfix {

void update_direction(DirectionState& d, const DirectionLimits& limits, int64_t t_us, double magnitude,
                      double predicted, double variance) {
  // (W.8.1): log N(m - v) - log N(m + v) = 2 m v / S
  const double evidence = 2.0 * magnitude * predicted / variance;
  if (d.sign != 0) {
    if (magnitude < vehicle::kSignKnown && d.sign * evidence < -limits.evidence)
      d = {evidence > 0.0 ? 1 : -1, false, {}};
    return;
  }
  if (evidence > limits.evidence) {
    d = {1, false, {}};
  } else if (evidence < -limits.evidence) {
    d = {-1, false, {}};
  } else if (!d.undecided_since_us) {
    d.undecided_since_us = t_us;
  } else if (seconds_between(*d.undecided_since_us, t_us) > limits.timeout) {
    d = {1, true, {}};
  }
}

}  // namespace roadfix
