#include "simulation/scene/pattern.h"

namespace roadfix {
namespace {

F8 band(F8 x, F8 w, float a, float b) { return coverage(x, w, splat(a), splat(b)); }

/// s and t in a lattice of pattern_s by pattern_t.
struct Cell {
  F8 s, t;
  U8 hash;
};
Cell cell_of(const SurfaceLanes& p) {
  const I8 ix = floor_int(p.s / p.pattern_s);
  const I8 iy = floor_int(p.t / p.pattern_t);
  return {p.s - to_float(ix) * p.pattern_s, p.t - to_float(iy) * p.pattern_t,
          hash_cell(add_wrapping(ix, multiply_wrapping(p.block_s, I8{} + 4096)),
                    add_wrapping(iy, multiply_wrapping(p.block_t, I8{} + 4096)), p.key)};
}

/// A worn line: white where it is not rubbed off.
F8 line(F8 below, F8 covered, F8 speckle) { return mix(below, 0.62F + 2.0F * speckle, covered); }

/// Metres to the left of the driven line: what lies to its right is in the block before, near that one's end.
F8 left_of_line(const SurfaceLanes& p) {
  constexpr auto kBlock = static_cast<float>(kTextureBlock_m);
  return select(p.t > 0.5F * kBlock, p.t - kBlock, p.t);
}

F8 lanes(const SurfaceLanes& p, F8 below, F8 speckle, Pattern pattern) {
  const bool motorway = pattern == Pattern::kThreeLanes;
  const F8 t = left_of_line(p);
  const F8 dash =
      periodic_coverage(p.s, p.width_s, splat(motorway ? 16.0F : 8.0F), splat(1.0F), splat(motorway ? 7.0F : 4.0F));
  F8 x = line(below, band(t, p.width_t, -1.80F, -1.65F), speckle);
  x = line(x, band(t, p.width_t, 1.69F, 1.81F) * dash, speckle);
  x = line(x, band(t, p.width_t, 5.15F, 5.30F) * (motorway ? dash : splat(1.0F)), speckle);
  if (motorway) return line(x, band(t, p.width_t, 8.65F, 8.80F), speckle);
  if (pattern == Pattern::kBareLanes) return x;
  // In one block of 64 m out of two a zebra crossing; arrows in front of it.
  const U8 h = hash_cell(p.block_s, I8{}, p.key);
  const F8 begin = 12.0F + 40.0F * fraction(h, 0);
  const F8 stripes = periodic_coverage(t + 64.0F, p.width_t, splat(1.0F), splat(0.25F), splat(0.75F));
  const F8 road = band(t, p.width_t, -1.5F, 5.0F);
  const F8 zebra = coverage(p.s, p.width_s, begin, begin + 3.5F) * stripes * road;
  const F8 stop = coverage(p.s, p.width_s, begin - 2.0F, begin - 1.6F) * band(t, p.width_t, -1.65F, 1.69F);
  const F8 shaft = coverage(p.s, p.width_s, begin - 9.0F, begin - 5.5F) * band(t, p.width_t, -0.09F, 0.09F);
  const F8 head = coverage(p.s, p.width_s, begin - 6.1F, begin - 5.5F) * band(t, p.width_t, -0.35F, 0.35F);
  return select(fraction(h, 16) < 0.5F, line(x, clamp01(zebra + stop + max(shaft, head)), speckle), x);
}

F8 windows(const SurfaceLanes& p, F8 below, F8 speckle) {
  const Cell c = cell_of(p);
  const F8 w = p.pattern_s;
  const F8 h = p.pattern_t;
  const F8 left = w * (0.22F + 0.10F * fraction(p.key, 0));
  const F8 top = h * (0.80F + 0.10F * fraction(p.key, 8));
  const F8 low = h * (0.26F + 0.12F * fraction(p.key, 16));
  const F8 frame = splat(0.09F);
  const F8 outer =
      coverage(c.s, p.width_s, left - frame, w - left + frame) * coverage(c.t, p.width_t, low - frame, top + frame);
  const F8 inner = coverage(c.s, p.width_s, left, w - left) * coverage(c.t, p.width_t, low, top);
  const F8 middle = 0.5F * w;
  const F8 cross_t = low + (top - low) * 0.62F;
  const F8 bars = clamp01(coverage(c.s, p.width_s, middle - 0.035F, middle + 0.035F) +
                          coverage(c.t, p.width_t, cross_t - 0.03F, cross_t + 0.03F));
  const F8 blind = coverage(c.t, p.width_t, low + (top - low) * fraction(c.hash, 8), top);
  const F8 pane = mix(0.04F + 0.12F * fraction(c.hash, 0), splat(0.45F),
                      blind * select(fraction(c.hash, 16) < 0.4F, splat(1.0F), splat(0.0F)));
  const F8 trim = select(fraction(p.key, 24) < 0.5F, below * 0.55F, below * 0.5F + 0.4F);
  const F8 wall = mix(below + speckle, trim, periodic_coverage(p.t, p.width_t, p.pattern_t, splat(0.0F), splat(0.14F)));
  return mix(mix(wall, trim, outer), mix(pane, trim, bars), inner);
}

F8 courses(const SurfaceLanes& p, F8 below, F8 speckle) {
  const Cell c = cell_of(p);
  const F8 joint = min(splat(0.03F), 0.06F * p.pattern_t);
  const F8 covered = clamp01(periodic_coverage(p.s, p.width_s, p.pattern_s, splat(0.0F), joint) +
                             periodic_coverage(p.t, p.width_t, p.pattern_t, splat(0.0F), joint));
  const F8 stone = below * (0.85F + 0.3F * fraction(c.hash, 0)) + speckle;
  return mix(stone, below * 0.5F, covered);
}

/// Share of the footprint within `radius` of (s, t), to a tenth or so: its edge is a ramp as wide as the footprint.
F8 disc(const SurfaceLanes& p, float s, float t, float radius) {
  const F8 ds = p.s - s;
  const F8 dt = p.t - t;
  const F8 width = max(max(p.width_s, p.width_t), splat(1e-3F));
  return clamp01((radius - root(ds * ds + dt * dt)) / width + 0.5F);
}

/// Length 4.3 m: wheels at 0.8 and 3.4, dark windows from 0.85 m up.
F8 car_side(const SurfaceLanes& p, F8 below) {
  const F8 wheels = disc(p, 0.8F, 0.31F, 0.34F) + disc(p, 3.4F, 0.31F, 0.34F);
  const F8 hubs = disc(p, 0.8F, 0.31F, 0.17F) + disc(p, 3.4F, 0.31F, 0.17F);
  const F8 glass =
      (band(p.s, p.width_s, 1.05F, 1.95F) + band(p.s, p.width_s, 2.05F, 2.90F)) * band(p.t, p.width_t, 0.92F, 1.36F);
  const F8 handles =
      (band(p.s, p.width_s, 1.75F, 1.95F) + band(p.s, p.width_s, 2.65F, 2.85F)) * band(p.t, p.width_t, 0.76F, 0.80F);
  const F8 doors =
      (band(p.s, p.width_s, 1.98F, 2.01F) + band(p.s, p.width_s, 2.97F, 3.0F)) * band(p.t, p.width_t, 0.3F, 0.92F);
  const F8 sill = band(p.t, p.width_t, 0.0F, 0.28F);
  const F8 body = mix(mix(below, splat(0.05F), clamp01(handles + doors + sill)), splat(0.05F), glass);
  return mix(mix(body, splat(0.04F), wheels), splat(0.45F), hubs);
}

/// Width 1.8 m: lights left and right, a plate, the rear window.
F8 car_end(const SurfaceLanes& p, F8 below) {
  const F8 lights =
      (band(p.s, p.width_s, 0.08F, 0.42F) + band(p.s, p.width_s, 1.38F, 1.72F)) * band(p.t, p.width_t, 0.58F, 0.78F);
  const F8 plate = band(p.s, p.width_s, 0.64F, 1.16F) * band(p.t, p.width_t, 0.42F, 0.54F);
  const F8 glass = band(p.s, p.width_s, 0.25F, 1.55F) * band(p.t, p.width_t, 0.95F, 1.36F);
  const F8 bumper = band(p.t, p.width_t, 0.0F, 0.36F);
  F8 x = mix(below, splat(0.05F), clamp01(glass + bumper));
  x = mix(x, select(fraction(p.key, 0) < 0.5F, splat(0.75F), splat(0.12F)), lights);
  return mix(x, splat(0.8F), plate);
}

F8 squares(const SurfaceLanes& p) {
  const F8 half = splat(0.5F);
  const F8 s =
      periodic_coverage(p.s / p.pattern_s + 64.0F, p.width_s / p.pattern_s, splat(2.0F), splat(0.0F), splat(1.0F)) -
      half;
  const F8 t =
      periodic_coverage(p.t / p.pattern_s + 64.0F, p.width_t / p.pattern_s, splat(2.0F), splat(0.0F), splat(1.0F)) -
      half;
  return 0.45F + 1.6F * s * t;
}

/// A rim and six random bars of "writing".
F8 sign(const SurfaceLanes& p, F8 below) {
  const F8 rim = splat(0.05F);
  const F8 inner = coverage(p.s, p.width_s, rim, p.pattern_s - rim) * coverage(p.t, p.width_t, rim, p.pattern_t - rim);
  const F8 ground = select(fraction(p.key, 0) < 0.5F, splat(0.12F), splat(0.75F));
  const F8 ink = 0.85F - ground;
  F8 x = mix(ink, ground, inner);
  for (std::uint32_t k = 0; k < 6; ++k) {
    const U8 h = mix_bits(p.key + 77U * (k + 1U));
    const F8 s0 = p.pattern_s * (0.12F + 0.5F * fraction(h, 0));
    const F8 t0 = p.pattern_t * (0.12F + 0.12F * static_cast<float>(k));
    x = mix(x, ink,
            coverage(p.s, p.width_s, s0, s0 + p.pattern_s * (0.08F + 0.2F * fraction(h, 8))) *
                coverage(p.t, p.width_t, t0, t0 + 0.07F * p.pattern_t));
  }
  return mix(x, below, splat(0.1F));
}

F8 bays(const SurfaceLanes& p, F8 below, F8 speckle) {
  const F8 bar = periodic_coverage(p.s, p.width_s, p.pattern_s, splat(0.0F), splat(0.12F));
  return line(below, bar, speckle);
}

F8 paint_one(Pattern pattern, const SurfaceLanes& p, F8 base, F8 speckle) {
  switch (pattern) {
    case Pattern::kNone:
      return base + speckle;
    case Pattern::kTwoLanes:
    case Pattern::kBareLanes:
    case Pattern::kThreeLanes:
      return lanes(p, base + speckle, speckle, pattern);
    case Pattern::kWindows:
      return windows(p, base, speckle);
    case Pattern::kCourses:
      return courses(p, base, speckle);
    case Pattern::kCarSide:
      return car_side(p, base + speckle);
    case Pattern::kCarEnd:
      return car_end(p, base + speckle);
    case Pattern::kSquares:
      return squares(p);
    case Pattern::kSign:
      return sign(p, base + speckle);
    case Pattern::kBays:
      return bays(p, base + speckle, speckle);
  }
  return base;
}

}  // namespace

F8 periodic_coverage(F8 x, F8 w, F8 period, F8 a, F8 b) {
  w = max(w, splat(1e-5F));
  const auto integral = [&](F8 at) {
    const F8 n = to_float(floor_int(at / period));
    return n * (b - a) + clamp(at - n * period, a, b) - a;
  };
  return (integral(x + 0.5F * w) - integral(x - 0.5F * w)) / w;
}

F8 paint(const SurfaceLanes& p, F8 base, F8 speckle) {
  F8 result = base;
  std::uint32_t done = 0;  // patterns present in these lanes, each painted once
  for (int i = 0; i < kLanes; ++i) {
    const auto pattern = static_cast<std::uint32_t>(p.pattern[i]);
    if ((done >> pattern & 1U) != 0U) continue;
    done |= 1U << pattern;
    result = select(p.pattern == p.pattern[i], paint_one(static_cast<Pattern>(pattern), p, base, speckle), result);
  }
  return result;
}

}  // namespace roadfix
