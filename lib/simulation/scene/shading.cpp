#include "simulation/scene/shading.h"

#include <algorithm>
#include <cmath>

#include "simulation/scene/texture.h"

namespace roadfix {
namespace {

constexpr float kHaze_m = 700.0F;  // where half of what one sees is haze
constexpr float kHorizon = 0.62F;  // radiance of the sky, white in the sun = 1
constexpr float kZenith = 0.36F;
constexpr float kCloud_m = 900.0F;        // height of the clouds
constexpr float kShadowOffset_m = 0.01F;  // ray origins are lifted off the surface by this
constexpr float kShadowReach_m = 120.0F;  // longer shadows than any house's at noon
constexpr float kWidest_m = 60.0F;        // of a footprint

using V8 = Lanes3;
F8 dot(const V8& a, const V8& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

/// The faces under eight pixels, lane by lane; the sky's lanes hold face 0.
struct FaceLanes {
  V8 normal, grad_s, grad_t;
  F8 extent_s, extent_t, light[4];
  SurfaceLanes surface;
};

/// FaceShade's words, each in eight lanes.
FaceLanes lanes_of(const F8 (&w)[32]) {
  FaceLanes f;
  f.normal = {w[0], w[1], w[2]};
  f.grad_s = {w[3], w[4], w[5]};
  f.grad_t = {w[6], w[7], w[8]};
  f.surface.s = w[9];
  f.surface.t = w[10];
  f.extent_s = w[11];
  f.extent_t = w[12];
  f.surface.block_s = (I8)w[13];
  f.surface.block_t = (I8)w[14];
  for (int k = 0; k < 4; ++k) f.light[k] = w[15 + k];
  f.surface.tint = w[19];
  f.surface.pattern_s = w[20];
  f.surface.pattern_t = w[21];
  f.surface.material = (I8)w[22];
  f.surface.pattern = (I8)w[23];
  f.surface.key = (U8)w[24];
  return f;
}

FaceLanes gather(const RayWindow& window, const HitLanes& hit) {
  const auto words = [&](int face) {
    return reinterpret_cast<const float*>(&window.faces()[static_cast<std::size_t>(std::max(face, 0))]);
  };
  F8 w[32];
  if (hit.face[0] >= 0 && !any(hit.face != hit.face[0])) {  // the usual case
    const float* const one = words(hit.face[0]);
    for (int k = 0; k < 32; ++k) w[k] = splat(one[k]);
    return lanes_of(w);
  }
  for (int part = 0; part < 4; ++part) {
    F8 rows[kLanes];
    for (int i = 0; i < kLanes; ++i) rows[i] = load(words(hit.face[i]) + kLanes * part);
    transpose(rows);
    std::copy(rows, rows + kLanes, w + kLanes * part);
  }
  return lanes_of(w);
}

/// Moves coordinates beyond the block's end into the next blocks.
void carry_block(F8& x, I8& block) {
  const I8 over = floor_int(x * static_cast<float>(1.0 / kTextureBlock_m));
  x -= to_float(over) * static_cast<float>(kTextureBlock_m);
  block = add_wrapping(block, over);
}

/// Texture coordinates and footprint of the points hit: a step of one pixel moves the point in the face's plane.
void locate(const PixelRays& p, const HitLanes& hit, const V8& direction, FaceLanes& f) {
  SurfaceLanes& x = f.surface;
  x.s += hit.u * f.extent_s;
  x.t += hit.v * f.extent_t;
  carry_block(x.s, x.block_s);
  carry_block(x.t, x.block_t);
  const F8 along = dot(f.normal, direction);
  const auto step = [&](const V8& d) {
    const F8 slide = dot(f.normal, d) / along;
    return V8{hit.distance * (d.x - slide * direction.x), hit.distance * (d.y - slide * direction.y),
              hit.distance * (d.z - slide * direction.z)};
  };
  const V8 u = step({p.dx_u, p.dy_u, p.dz_u});
  const V8 v = step({p.dx_v, p.dy_v, p.dz_v});
  x.width_s = min(abs(dot(f.grad_s, u)) + abs(dot(f.grad_s, v)), splat(kWidest_m));
  x.width_t = min(abs(dot(f.grad_t, u)) + abs(dot(f.grad_t, v)), splat(kWidest_m));
}

F8 sky(const V8& d, const F8& length) {
  const F8 up = max(d.z / length, splat(0.0F));
  const F8 clear = kHorizon + (kZenith - kHorizon) * clamp01(up * 2.0F);
  // Clouds: grain of a plane high above, anchored to the window so far away that nobody sees it move.
  SurfaceLanes p{};
  const F8 reach = kCloud_m / max(d.z, splat(1e-3F) * length);
  p.s = clamp(d.x * reach, splat(-20000.0F), splat(20000.0F)) * (1.0F / 64.0F);
  p.t = clamp(d.y * reach, splat(-20000.0F), splat(20000.0F)) * (1.0F / 64.0F);
  p.material += static_cast<std::int32_t>(Material::kGround);
  p.tint = splat(1.0F);
  p.width_s = p.width_t = splat(0.35F);
  const F8 cloud = (albedo(p) - 0.22F) * clamp01(up * 6.0F);
  return clear + 1.2F * cloud;
}

}  // namespace

Shade shade(const RayWindow& window, const Eigen::Vector3f& to_sun, const PixelRays& pixels, const HitLanes& hit) {
  const V8& d = pixels.ray.direction;
  const F8 length = root(dot(d, d));
  const I8 is_sky = hit.face < 0;
  Shade out{splat(0.0F), I8{}};
  if (any(hit.face >= 0)) {
    HitLanes safe = hit;
    safe.distance = select(is_sky, splat(1.0F), hit.distance);
    FaceLanes f = gather(window, hit);
    const F8 towards = select(dot(f.normal, d) > 0.0F, splat(-1.0F), splat(1.0F));
    const V8 n{f.normal.x * towards, f.normal.y * towards, f.normal.z * towards};
    locate(pixels, safe, d, f);
    const F8 facing = n.x * to_sun.x() + n.y * to_sun.y() + n.z * to_sun.z();
    const I8 lamp = f.surface.material == static_cast<std::int32_t>(Material::kLamp);
    const I8 day = (facing > 0.0F) & ~is_sky & ~lamp;
    if (any(day)) {
      const F8 lift = kShadowOffset_m + 2e-4F * safe.distance;
      const V8& o = pixels.ray.origin;
      const V8 lifted{o.x + safe.distance * d.x + lift * n.x, o.y + safe.distance * d.y + lift * n.y,
                      o.z + safe.distance * d.z + lift * n.z};
      out.sunlit = day & ~window.shaded(lifted, day, kShadowReach_m);
    }
    const F8 u = hit.u;
    const F8 v = hit.v;
    const F8 ambient = mix(mix(f.light[0], f.light[1], u), mix(f.light[3], f.light[2], u), v);
    const F8 light = ambient + select(out.sunlit, facing, splat(0.0F));
    const F8 radiance = select(lamp, f.surface.tint, albedo(f.surface) * light);
    const F8 far = safe.distance * length * (1.0F / kHaze_m);
    // What lies in the dark has no lit air before it.
    const F8 haze = far * far / (1.0F + far * far) * clamp01(ambient * 8.0F);
    out.radiance = mix(radiance, splat(kHorizon), haze);
  }
  if (any(is_sky)) out.radiance = select(is_sky, sky(d, length), out.radiance);
  return out;
}

}  // namespace roadfix
