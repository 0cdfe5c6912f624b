/// Eight rays against one triangle (Moeller and Trumbore, "Fast, minimum storage ray/triangle intersection", 1997), in
/// the order of operations that Embree 3 uses, so that both find the same distances bit by bit.
#pragma once

#include <array>

#include "simulation/scene/lanes.h"

namespace roadfix {

using Float3 = std::array<float, 3>;

/// Half of a face: corners 0, 1, 3 of it (even) or 2, 3, 1 (odd).
struct Triangle {
  Float3 corner;  ///< the first, window coordinates
  Float3 edge1;   ///< from the second corner to the first
  Float3 edge2;   ///< from the first to the third
  Float3 normal;  ///< edge2 x edge1, any length
  float edges;    ///< lengths of edge1 and edge2, m
};

/// Coordinates of a hit are to be divided by `scale`, and count from the face's corner 0 or 2.
struct TriangleHit {
  I8 valid;
  I8 at_edge;  ///< valid or not, but only just
  F8 u, v, distance, scale;
};

struct Lanes3 {
  F8 x, y, z;
};
inline Lanes3 splat(const Float3& v) { return {splat(v[0]), splat(v[1]), splat(v[2])}; }
inline F8 dot_fused(const Lanes3& a, const Lanes3& b) { return fused(a.x, b.x, fused(a.y, b.y, a.z * b.z)); }
inline Lanes3 cross_fused(const Lanes3& a, const Lanes3& b) {
  return {fused(a.y, b.z, -(a.z * b.y)), fused(a.z, b.x, -(a.x * b.z)), fused(a.x, b.y, -(a.y * b.x))};
}

/// The triangles of a face, from the same arithmetic in one lane.
std::array<Triangle, 2> triangles_of(const std::array<Float3, 4>& corner);

/// `from_origin`: the triangle's first corner seen from the ray's origin. Hits lie beyond the origin and not beyond
/// `reach` lengths of the direction. `edge_m`: how near to an edge is at it.
inline TriangleHit meet(const Triangle& t, const Lanes3& from_origin, const Lanes3& direction, F8 reach, float edge_m) {
  const Lanes3 normal = splat(t.normal);
  const Lanes3 r = cross_fused(from_origin, direction);
  const F8 det = dot_fused(normal, direction);
  const I8 sign = (I8)det & (I8)splat(-0.0F);
  const auto turned = [sign](F8 x) { return (F8)((I8)x ^ sign); };
  TriangleHit hit;
  hit.scale = turned(det);
  hit.u = turned(dot_fused(r, splat(t.edge2)));
  hit.v = turned(dot_fused(r, splat(t.edge1)));
  const F8 inside = min(min(hit.u, hit.v), hit.scale - hit.u - hit.v);
  hit.distance = turned(dot_fused(normal, from_origin));
  const I8 within_reach = (hit.scale > 0.0F) & (hit.distance > 0.0F) & (hit.distance <= hit.scale * reach);
  hit.valid = (inside >= 0.0F) & within_reach;
  hit.at_edge = (abs(inside) < edge_m * t.edges) & within_reach;
  return hit;
}

}  // namespace roadfix
