/// What is painted on faces: rectangles averaged over the footprint exactly.
#pragma once

#include "simulation/scene/texture.h"

namespace roadfix {

/// Share of [x - w/2, x + w/2] that lies in [a, b].
inline F8 coverage(F8 x, F8 w, F8 a, F8 b) {
  w = max(w, splat(1e-5F));
  return (clamp(x + 0.5F * w, a, b) - clamp(x - 0.5F * w, a, b)) / w;
}

/// The same for [a, b] repeated every `period`, 0 <= a <= b <= period.
F8 periodic_coverage(F8 x, F8 w, F8 period, F8 a, F8 b);

/// Albedo of the face's pattern over a surface of albedo `base` and grain `speckle`.
F8 paint(const SurfaceLanes& x, F8 base, F8 speckle);

}  // namespace roadfix
