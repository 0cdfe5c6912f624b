/// From one ENU frame to another.
#pragma once

#include "geodesy/enu_anchor.h"
#include "geometry/se3.h"

namespace roadfix {

bool same_anchor(const Geodetic& a, const Geodetic& b);

/// Takes coordinates of the frame at `from` to that at `to`, exact at any distance.
SE3 T_enu_enu(const Geodetic& to, const Geodetic& from);

}  // namespace roadfix
