#include "simulation/scene/texture.h"

#include <iterator>

#include "simulation/scene/pattern.h"

namespace roadfix {
namespace {

/// One scale of grain: cells of size_s by size_t (m, powers of two, so that dividing by them is exact), albedo +-
/// amplitude.
struct Layer {
  float size_s, size_t, amplitude;
};
constexpr int kSmooth = 3;
constexpr int kPatches = 3;
struct Grain {
  float albedo;
  Layer smooth[kSmooth];
  Layer patch[kPatches];
};

// Albedos: road 0.1-0.2, concrete 0.3-0.5, plaster 0.4-0.7, brick 0.2-0.3 (Oke, Boundary Layer Climates, 1987, table
// 8.1). Cells from centimetres (texture at arm's length) to metres (what is left of it 40 m away); amplitudes by eye.
constexpr Grain kGrain[] = {
    /* asphalt  */ {0.20F,
                    {{0.03125F, 0.03125F, 0.05F}, {0.5F, 0.25F, 0.03F}, {8.0F, 0.5F, 0.03F}},
                    {{0.125F, 0.0625F, 0.05F}, {1.0F, 0.25F, 0.06F}, {8.0F, 1.0F, 0.06F}}},
    /* pavement */
    {0.34F,
     {{0.03125F, 0.03125F, 0.05F}, {0.25F, 0.25F, 0.04F}, {4.0F, 1.0F, 0.04F}},
     {{0.125F, 0.125F, 0.04F}, {0.5F, 0.5F, 0.09F}, {4.0F, 2.0F, 0.08F}}},
    /* ground   */
    {0.22F,
     {{0.125F, 0.125F, 0.06F}, {1.0F, 1.0F, 0.06F}, {8.0F, 8.0F, 0.05F}},
     {{0.25F, 0.25F, 0.06F}, {2.0F, 2.0F, 0.06F}, {16.0F, 16.0F, 0.04F}}},
    /* plaster  */
    {0.50F,
     {{0.0625F, 0.0625F, 0.03F}, {0.5F, 0.5F, 0.03F}, {4.0F, 2.0F, 0.05F}},
     {{0.25F, 0.25F, 0.05F}, {1.0F, 1.0F, 0.05F}, {4.0F, 4.0F, 0.04F}}},
    /* brick    */
    {0.28F,
     {{0.0625F, 0.0625F, 0.03F}, {0.5F, 0.5F, 0.03F}, {4.0F, 2.0F, 0.04F}},
     {{0.25F, 0.125F, 0.09F}, {1.0F, 0.5F, 0.04F}, {4.0F, 4.0F, 0.04F}}},
    /* roof     */
    {0.24F,
     {{0.125F, 0.125F, 0.03F}, {1.0F, 1.0F, 0.03F}, {4.0F, 4.0F, 0.03F}},
     {{0.5F, 0.25F, 0.07F}, {2.0F, 2.0F, 0.03F}, {8.0F, 8.0F, 0.02F}}},
    /* concrete */
    {0.40F,
     {{0.0625F, 0.0625F, 0.03F}, {1.0F, 0.5F, 0.05F}, {0.5F, 4.0F, 0.05F}},
     {{0.25F, 0.25F, 0.10F}, {1.0F, 1.0F, 0.10F}, {4.0F, 4.0F, 0.06F}}},
    /* tunnel   */
    {0.50F,
     {{0.0625F, 0.0625F, 0.03F}, {0.5F, 1.0F, 0.05F}, {4.0F, 1.0F, 0.05F}},
     {{0.25F, 0.25F, 0.12F}, {1.0F, 0.5F, 0.16F}, {4.0F, 2.0F, 0.08F}}},
    /* blank    */
    {0.62F,
     {{0.125F, 0.125F, 0.004F}, {1.0F, 1.0F, 0.006F}, {8.0F, 8.0F, 0.01F}},
     {{0.125F, 0.125F, 0.0F}, {1.0F, 1.0F, 0.0F}, {8.0F, 8.0F, 0.0F}}},
    /* car body */
    {0.45F,
     {{0.125F, 0.125F, 0.01F}, {1.0F, 1.0F, 0.04F}, {4.0F, 0.5F, 0.03F}},
     {{0.25F, 0.125F, 0.01F}, {1.0F, 1.0F, 0.0F}, {4.0F, 4.0F, 0.0F}}},
    /* metal    */
    {0.38F,
     {{0.0625F, 0.0625F, 0.02F}, {0.5F, 0.5F, 0.04F}, {4.0F, 2.0F, 0.03F}},
     {{0.25F, 0.25F, 0.09F}, {1.0F, 1.0F, 0.08F}, {4.0F, 4.0F, 0.03F}}},
    /* lamp     */
    {0.90F,
     {{1.0F, 1.0F, 0.0F}, {1.0F, 1.0F, 0.0F}, {1.0F, 1.0F, 0.0F}},
     {{1.0F, 1.0F, 0.0F}, {1.0F, 1.0F, 0.0F}, {1.0F, 1.0F, 0.0F}}},
    /* board    */
    {0.50F,
     {{1.0F, 1.0F, 0.0F}, {1.0F, 1.0F, 0.0F}, {1.0F, 1.0F, 0.0F}},
     {{1.0F, 1.0F, 0.0F}, {1.0F, 1.0F, 0.0F}, {1.0F, 1.0F, 0.0F}}},
};

constexpr int kMaterials = static_cast<int>(std::size(kGrain));

/// One layer of all materials, to be looked up by the number of a material.
struct LayerTable {
  float per_s[kMaterials], per_t[kMaterials], amplitude[kMaterials];  // one over the sizes
};

constexpr LayerTable table_of(const Layer& (*layer)(const Grain&, int), int k) {
  LayerTable out{};
  for (int m = 0; m < kMaterials; ++m) {
    const Layer& l = layer(kGrain[m], k);
    out.per_s[m] = 1.0F / l.size_s;
    out.per_t[m] = 1.0F / l.size_t;
    out.amplitude[m] = l.amplitude;
  }
  return out;
}
constexpr const Layer& smooth_layer(const Grain& g, int k) { return g.smooth[k]; }
constexpr const Layer& patch_layer(const Grain& g, int k) { return g.patch[k]; }
constexpr LayerTable kSmoothTables[kSmooth] = {table_of(smooth_layer, 0), table_of(smooth_layer, 1),
                                               table_of(smooth_layer, 2)};
constexpr LayerTable kPatchTables[kPatches] = {table_of(patch_layer, 0), table_of(patch_layer, 1),
                                               table_of(patch_layer, 2)};

/// A layer under each lane.
struct LayerLanes {
  F8 per_s, per_t, amplitude;
  F8 wx, wy;  ///< footprint in cells
};

LayerLanes layer_under(const SurfaceLanes& p, bool one_material, const LayerTable& table) {
  LayerLanes l;
  if (one_material) {
    const auto m = static_cast<std::size_t>(p.material[0]);
    l.per_s = splat(table.per_s[m]);
    l.per_t = splat(table.per_t[m]);
    l.amplitude = splat(table.amplitude[m]);
  } else {
    l.per_s = look_up(table.per_s, p.material);
    l.per_t = look_up(table.per_t, p.material);
    l.amplitude = look_up(table.amplitude, p.material);
  }
  l.wx = p.width_s * l.per_s;
  l.wy = p.width_t * l.per_t;
  return l;
}

/// A layer's cell under each lane.
struct Cells {
  I8 x, y;    ///< lattice numbers, the same from every block
  F8 fx, fy;  ///< place in the cell, 0 to 1
};

Cells cells_of(const SurfaceLanes& p, const LayerLanes& layer) {
  Cells c;
  const F8 x = p.s * layer.per_s;
  const F8 y = p.t * layer.per_t;
  const I8 ix = floor_int(x);
  const I8 iy = floor_int(y);
  constexpr auto kBlock = static_cast<float>(kTextureBlock_m);
  c.x = add_wrapping(ix, multiply_wrapping(p.block_s, to_int(kBlock * layer.per_s)));
  c.y = add_wrapping(iy, multiply_wrapping(p.block_t, to_int(kBlock * layer.per_t)));
  c.fx = x - to_float(ix);
  c.fy = y - to_float(iy);
  return c;
}

/// Value noise, zero mean: the lattice points' random values, joined smoothly.
F8 smooth_noise(const SurfaceLanes& p, const LayerLanes& layer, U8 key) {
  const F8 keep = clamp01(1.25F - layer.wx) * clamp01(1.25F - layer.wy);
  if (!any(keep > 0.0F)) return splat(0.0F);
  const Cells c = cells_of(p, layer);
  const F8 ease_x = c.fx * c.fx * (3.0F - 2.0F * c.fx);
  const F8 ease_y = c.fy * c.fy * (3.0F - 2.0F * c.fy);
  const I8 x = add_wrapping(c.x, I8{} + 1);  // the far corner
  const I8 y = add_wrapping(c.y, I8{} + 1);
  const F8 low = mix(fraction(hash_cell(c.x, c.y, key), 0), fraction(hash_cell(x, c.y, key), 0), ease_x);
  const F8 high = mix(fraction(hash_cell(c.x, y, key), 0), fraction(hash_cell(x, y, key), 0), ease_x);
  return layer.amplitude * keep * (2.0F * mix(low, high, ease_y) - 1.0F);
}

/// In two of three cells a rectangle of random place, size and shade: the shade times the share covered.
F8 patch_of(const Cells& c, const LayerLanes& layer, U8 key) {
  const U8 h = hash_cell(c.x, c.y, key);
  const U8 g = mix_bits(h + 0x9E3779B9U);
  const F8 left = 0.06F + 0.45F * fraction(h, 0);
  const F8 bottom = 0.06F + 0.45F * fraction(h, 8);
  const F8 covered = coverage(c.fx, layer.wx, left, left + 0.12F + 0.30F * fraction(h, 16)) *
                     coverage(c.fy, layer.wy, bottom, bottom + 0.12F + 0.30F * fraction(h, 24));
  const F8 shade = 2.0F * fraction(g, 0) - 1.0F;
  return select(fraction(g, 8) < 0.66F, covered * (shade + select(shade < 0.0F, splat(-0.5F), splat(0.5F))),
                splat(0.0F));
}

/// The cells whose rectangles the footprint touches: it is at most one cell wide and may reach beyond its own on the
/// nearer side. Left out, rectangles seen from afar would lie beside their place.
F8 patches(const SurfaceLanes& p, const LayerLanes& layer, U8 key) {
  const F8 keep = clamp01(2.0F - 2.0F * layer.wx) * clamp01(2.0F - 2.0F * layer.wy);
  if (!any(keep > 0.0F)) return splat(0.0F);
  const Cells own = cells_of(p, layer);
  const I8 step_x = 1 + 2 * (own.fx < 0.5F), step_y = 1 + 2 * (own.fy < 0.5F);  // a mask is -1 where it holds
  const auto beside = [&](bool across, bool up) {
    Cells c = own;
    if (across) {
      c.x = add_wrapping(c.x, step_x);
      c.fx -= to_float(step_x);
    }
    if (up) {
      c.y = add_wrapping(c.y, step_y);
      c.fy -= to_float(step_y);
    }
    return patch_of(c, layer, key);
  };
  const bool across = any(abs(own.fx - 0.5F) + 0.5F * layer.wx > 0.5F);
  const bool up = any(abs(own.fy - 0.5F) + 0.5F * layer.wy > 0.5F);
  F8 shade = beside(false, false);
  if (across) shade += beside(true, false);
  if (up) shade += beside(false, true);
  if (across && up) shade += beside(true, true);
  return layer.amplitude * keep * shade;
}

}  // namespace

F8 albedo(const SurfaceLanes& p) {
  const bool one_material = !any(p.material != p.material[0]);
  F8 base;
  for (int i = 0; i < kLanes; ++i) base[i] = kGrain[p.material[i]].albedo;
  F8 speckle = splat(0.0F);
  for (std::uint32_t k = 0; k < kSmooth; ++k)
    speckle += smooth_noise(p, layer_under(p, one_material, kSmoothTables[k]), p.key + k);
  for (std::uint32_t k = 0; k < kPatches; ++k)
    speckle += patches(p, layer_under(p, one_material, kPatchTables[k]), p.key + k + kSmooth);
  return clamp(paint(p, base * p.tint, speckle), splat(0.01F), splat(0.95F));
}

}  // namespace roadfix
