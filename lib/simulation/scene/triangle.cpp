#include "simulation/scene/triangle.h"

#include <cmath>

namespace roadfix {
namespace {

using Double3 = std::array<double, 3>;

Float3 minus(const Float3& a, const Float3& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
Double3 minus(const Float3& a, const Double3& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
Double3 minus(const Double3& a, const Double3& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }

template <class Vector>
Vector cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

Triangle triangle(const Float3& a, const Float3& b, const Float3& c) {
  Triangle t{{a, b, c}, minus(a, b), minus(c, a), {}, 0.0F, 0.0F};
  t.normal = cross(t.edge2, t.edge1);
  const auto length = [](const Float3& x) { return std::sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]); };
  t.edges = length(t.edge1) + length(t.edge2);
  t.area = length(t.edge1) * length(t.edge2);
  return t;
}

}  // namespace

std::array<Triangle, 2> triangles_of(const std::array<Float3, 4>& corner) {
  return {triangle(corner[0], corner[1], corner[3]), triangle(corner[2], corner[3], corner[1])};
}

SightedTriangle sighted(const Triangle& triangle, const Double3& from) {
  const Double3 a = minus(triangle.corner[0], from);
  const Double3 b = minus(triangle.corner[1], from);
  const Double3 c = minus(triangle.corner[2], from);
  const Double3 normal = cross(minus(b, a), minus(c, a));
  return {cross(a, b), cross(b, c), cross(c, a), normal, (a[0] * normal[0] + a[1] * normal[1]) + a[2] * normal[2]};
}

void add_hit(const SightedTriangle& t, int triangle, const Double3& direction, double reach, RayHit& hit) {
  const RayProducts<double> p = products(t, direction[0], direction[1], direction[2]);
  const bool inside = (p.a >= 0.0 && p.b >= 0.0 && p.c >= 0.0) || (p.a <= 0.0 && p.b <= 0.0 && p.c <= 0.0);
  if (!inside || p.along == 0.0 || (p.a + p.b) + p.c == 0.0) return;
  const double distance = t.height / p.along;
  if (!(distance > 0.0 && distance <= reach)) return;
  const bool first =
      hit.triangle < 0 || distance < hit.distance || (distance == hit.distance && triangle < hit.triangle);
  if (first) hit = {triangle, distance};
}

}  // namespace roadfix
