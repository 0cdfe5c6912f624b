/// Light that comes from a surface point or from the sky towards the camera.
#pragma once

#include "simulation/scene/ray_scene.h"

namespace roadfix {

/// Rays, and how their directions change from a pixel to its neighbours (same lengths).
struct PixelRays {
  RayLanes ray;
  F8 dx_u, dy_u, dz_u;
  F8 dx_v, dy_v, dz_v;
};

struct Shade {
  F8 radiance;
  I8 sunlit;  ///< -1 where the sun reaches the point
};

Shade shade(const RayWindow& window, const Eigen::Vector3f& to_sun, const PixelRays& pixels, const HitLanes& hit);

}  // namespace roadfix
