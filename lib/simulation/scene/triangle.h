/// A ray against one triangle, twice: in floats, eight rays at a time, with a bound on the rounding, which finds quickly
/// what may be hit; and in doubles, by sums, products and quotients alone, which decides (MODEL.md, section 5).
/// So no picture depends on an instruction that makers of processors implement differently.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "simulation/scene/lanes.h"

namespace roadfix {

using Float3 = std::array<float, 3>;

/// Half of a face: corners 0, 1, 3 of it (even) or 2, 3, 1 (odd).
struct Triangle {
  std::array<Float3, 3> corner;  ///< window coordinates
  Float3 edge1;                  ///< from the second corner to the first
  Float3 edge2;                  ///< from the first to the third
  Float3 normal;                 ///< edge2 x edge1, any length
  float edges;                   ///< lengths of edge1 and edge2, m
  float area;                    ///< product of these lengths, m2
};

struct Lanes3 {
  F8 x, y, z;
};
inline Lanes3 splat(const Float3& v) { return {splat(v[0]), splat(v[1]), splat(v[2])}; }
inline F8 dot_fused(const Lanes3& a, const Lanes3& b) { return fused(a.x, b.x, fused(a.y, b.y, a.z * b.z)); }
inline Lanes3 cross_fused(const Lanes3& a, const Lanes3& b) {
  return {fused(a.y, b.z, -(a.z * b.y)), fused(a.z, b.x, -(a.x * b.z)), fused(a.x, b.y, -(a.y * b.x))};
}

/// The triangles of a face.
std::array<Triangle, 2> triangles_of(const std::array<Float3, 4>& corner);

/// What floats decide of a hit.
struct Proposal {
  I8 possible;   ///< a hit, whatever the rounding was, lies in these lanes
  I8 certain;    ///< of those, the lanes that hit in spite of any rounding
  F8 near, far;  ///< bounds of the distance where certain
};

/// Largest error of the products below, relative to the lengths of their factors: seven roundings of 2^-24 each in
/// three coordinates, and a margin.
constexpr float kFloatError = 1e-6F;

/// `from_origin`: the triangle's first corner seen from the ray's origin, `length` metres away at most. Hits lie beyond
/// the origin and not beyond `reach` lengths of the direction, whose own length is at most `longest`. Moeller and
/// Trumbore, "Fast, minimum storage ray/triangle intersection", 1997.
inline Proposal propose(const Triangle& t, const Lanes3& from_origin, F8 length, const Lanes3& direction, float longest,
                        F8 reach) {
  const Lanes3 normal = splat(t.normal);
  const Lanes3 r = cross_fused(from_origin, direction);
  const F8 det = dot_fused(normal, direction);
  const I8 sign = (I8)det & (I8)splat(-0.0F);
  const auto turned = [sign](F8 x) { return (F8)((I8)x ^ sign); };
  const F8 scale = turned(det);
  const F8 u = turned(dot_fused(r, splat(t.edge2)));
  const F8 v = turned(dot_fused(r, splat(t.edge1)));
  const F8 inside = min(min(u, v), scale - u - v);
  const F8 height = turned(dot_fused(normal, from_origin));
  const F8 scale_error = splat(kFloatError * longest * t.area);
  const F8 edge_error = 2.0F * kFloatError * longest * t.edges * length + scale_error;
  const F8 height_error = kFloatError * t.area * length;
  // Seen edge on, not even the sign of det is known; then a hit has all of u, v and scale near zero.
  const I8 edge_on = scale <= 2.0F * scale_error;
  const I8 within = (height > -height_error) & (height <= scale * reach + (height_error + scale_error * reach));
  Proposal p;
  p.possible = (inside > -edge_error) & (within | edge_on);
  p.certain = p.possible & (inside > edge_error) & ~edge_on & (height > height_error);
  if (!any(p.certain)) {
    p.near = p.far = splat(0.0F);
    return p;
  }
  const F8 distance = height / scale;
  const F8 uncertainty = 2.0F * (height_error + distance * scale_error) / scale;
  p.near = distance - uncertainty;
  p.far = distance + uncertainty;
  return p;
}

using D4 = double __attribute__((vector_size(32)));

/// A triangle as seen from one point, in doubles. The products of neighbouring corners make it watertight: triangles
/// that share an edge compute the same numbers for it, but for the sign.
struct SightedTriangle {
  std::array<double, 3> ab, bc, ca;  ///< a x b ..., corners from the point
  std::array<double, 3> normal;      ///< (b - a) x (c - a)
  double height;                     ///< a . normal
};
SightedTriangle sighted(const Triangle& triangle, const std::array<double, 3>& from);

/// Products of a triangle with a direction; T is double or four of them.
template <class T>
struct RayProducts {
  T a, b, c;  ///< weights of the corners, any scale
  T along;    ///< normal . direction
};
template <class T>
RayProducts<T> products(const SightedTriangle& t, const T& x, const T& y, const T& z) {
  const auto dot = [&](const std::array<double, 3>& n) { return (n[0] * x + n[1] * y) + n[2] * z; };
  return {dot(t.bc), dot(t.ca), dot(t.ab), dot(t.normal)};
}

/// The nearest hit so far of one ray; of two at one distance that of the lower triangle.
struct RayHit {
  int triangle = -1;  ///< none
  double distance = 0.0;
};

/// Takes the triangle into account, as far as it is hit beyond the origin and not beyond `reach`.
void add_hit(const SightedTriangle& t, int triangle, const std::array<double, 3>& direction, double reach, RayHit& hit);

/// Place of a hit on its face, along its edges from corner 0, u towards corner 1 and v towards corner 3.
template <class T>
void place_on_face(const RayProducts<T>& p, bool second_half, T& u, T& v) {
  const T sum = (p.a + p.b) + p.c;
  u = p.b / sum;
  v = p.c / sum;
  if (!second_half) return;
  u = 1.0 - u;
  v = 1.0 - v;
}

}  // namespace roadfix
