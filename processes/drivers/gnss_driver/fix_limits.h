/// What a receiver on a car can mean. A checksum says that the bytes came as they were sent, not that the numbers make
/// sense: 214 degrees of latitude, a speed of 1e40 m/s and a standard deviation of zero all pass it.
#pragma once

#include "samples/samples.h"

namespace roadfix {

/// What became of a fix.
struct FixLimits {
  bool publish = false;  ///< a fix without a position that can be is none
  int refused = 0;       ///< parts taken out: position, velocity, heading
};

/// Takes out of `fix` what cannot be. One that claims no position goes out in any case, as "no fix", and claims nothing
/// else either.
FixLimits limit_fix(GnssFix& fix);

}  // namespace roadfix
