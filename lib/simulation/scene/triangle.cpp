#include "simulation/scene/triangle.h"

#include <cmath>

namespace roadfix {
namespace {

Float3 minus(const Float3& a, const Float3& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }

Float3 cross(const Float3& a, const Float3& b) {
  return {std::fma(a[1], b[2], -(a[2] * b[1])), std::fma(a[2], b[0], -(a[0] * b[2])),
          std::fma(a[0], b[1], -(a[1] * b[0]))};
}

Triangle triangle(const Float3& a, const Float3& b, const Float3& c) {
  Triangle t{a, minus(a, b), minus(c, a), {}, 0.0F};
  t.normal = cross(t.edge2, t.edge1);
  const auto length = [](const Float3& x) { return std::sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]); };
  t.edges = length(t.edge1) + length(t.edge2);
  return t;
}

}  // namespace

std::array<Triangle, 2> triangles_of(const std::array<Float3, 4>& corner) {
  return {triangle(corner[0], corner[1], corner[3]), triangle(corner[2], corner[3], corner[1])};
}

}  // namespace roadfix
