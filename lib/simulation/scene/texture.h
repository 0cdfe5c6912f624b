/// What the surfaces look like: a procedural albedo at any point of any face, averaged over the pixel's footprint.
///
/// Each material has grain at several scales (smooth noise and sharp-edged patches, from hashes of the lattice cell and
/// the face's key), each face a pattern (windows, lane markings, ...). Rectangles are averaged over the footprint
/// exactly (a box as wide as the pixel's projection along s and along t), so their corners lie where they are drawn to
/// far below a pixel; grain fades out where its cells get smaller than the footprint.
#pragma once

#include "simulation/scene/lanes.h"
#include "simulation/scene/world.h"

namespace roadfix {

/// Texture coordinates count from multiples of this, so that floats stay exact far along a road; every grain cell
/// divides it.
inline constexpr double kTextureBlock_m = 64.0;

/// Eight surface points as seen by eight pixels.
struct SurfaceLanes {
  I8 material, pattern;
  U8 key;
  F8 tint, pattern_s, pattern_t;
  F8 s, t;              ///< m, from the block's origin
  F8 width_s, width_t;  ///< m, of the footprint
  I8 block_s, block_t;
};

/// Share of light reflected, in [0, 1].
F8 albedo(const SurfaceLanes& x);

}  // namespace roadfix
