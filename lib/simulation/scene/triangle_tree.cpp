#include "simulation/scene/triangle_tree.h"

#include <algorithm>
#include <limits>
#include <numeric>

namespace roadfix {
namespace {

constexpr std::uint32_t kLeaf = 4;   // triangles
constexpr double kMargin_m = 1e-6;   // around a box: far above the rounding of doubles within a window
constexpr double kShare = 1e-9;      // of distances
constexpr double kSteepest = 1e300;  // one over a direction's coordinate that is zero
constexpr double kNever = std::numeric_limits<double>::infinity();

Eigen::Vector3f vector(const Float3& x) { return {x[0], x[1], x[2]}; }

}  // namespace

TriangleTree::TriangleTree(std::span<const Triangle> triangles) : triangles_(triangles), order_(triangles.size()) {
  if (triangles.empty()) return;
  std::iota(order_.begin(), order_.end(), 0U);
  middles_.reserve(triangles.size());
  for (const Triangle& t : triangles)
    middles_.emplace_back(vector(t.corner[0]) + vector(t.corner[1]) + vector(t.corner[2]));
  nodes_.reserve(triangles.size());
  build(order_);
  middles_ = {};
}

std::uint32_t TriangleTree::build(std::span<std::uint32_t> part) {
  const auto at = static_cast<std::uint32_t>(nodes_.size());
  Eigen::Vector3f low = Eigen::Vector3f::Constant(std::numeric_limits<float>::infinity());
  Eigen::Vector3f high = -low;
  Eigen::Vector3f first = low;
  Eigen::Vector3f last = high;
  for (const std::uint32_t i : part) {
    for (const Float3& corner : triangles_[i].corner) {
      low = low.cwiseMin(vector(corner));
      high = high.cwiseMax(vector(corner));
    }
    first = first.cwiseMin(middles_[i]);
    last = last.cwiseMax(middles_[i]);
  }
  Node node{{}, {}, static_cast<std::uint32_t>(part.data() - order_.data()), static_cast<std::uint32_t>(part.size())};
  for (std::size_t k = 0; k < 3; ++k) {
    node.low[k] = static_cast<double>(low[static_cast<Eigen::Index>(k)]) - kMargin_m;
    node.high[k] = static_cast<double>(high[static_cast<Eigen::Index>(k)]) + kMargin_m;
  }
  nodes_.push_back(node);
  if (part.size() <= kLeaf) return at;
  Eigen::Index axis = 0;
  (last - first).maxCoeff(&axis);
  const auto half = static_cast<std::ptrdiff_t>(part.size() / 2);
  std::nth_element(part.begin(), part.begin() + half, part.end(), [&](std::uint32_t a, std::uint32_t b) {
    const float x = middles_[a][axis];
    const float y = middles_[b][axis];
    return x != y ? x < y : a < b;
  });
  build(part.first(static_cast<std::size_t>(half)));
  const std::uint32_t second = build(part.subspan(static_cast<std::size_t>(half)));
  nodes_[at].begin = second;
  nodes_[at].count = 0;
  return at;
}

template <bool kAny>
RayHit TriangleTree::search(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double reach) const {
  RayHit hit;
  if (nodes_.empty()) return hit;
  const std::array<double, 3> from{origin.x(), origin.y(), origin.z()};
  const std::array<double, 3> along{direction.x(), direction.y(), direction.z()};
  std::array<double, 3> inverse{};
  for (std::size_t k = 0; k < 3; ++k) inverse[k] = along[k] == 0.0 ? kSteepest : 1.0 / along[k];
  // Where the ray enters a box.
  const auto enters = [&](const Node& node, double farthest) {
    double begin = 0.0;
    double end = farthest;
    for (std::size_t k = 0; k < 3; ++k) {
      const double x = (node.low[k] - from[k]) * inverse[k];
      const double y = (node.high[k] - from[k]) * inverse[k];
      begin = std::max(begin, std::min(x, y));
      end = std::min(end, std::max(x, y));
    }
    return begin * (1.0 - kShare) <= end * (1.0 + kShare) ? begin : kNever;
  };
  struct Waiting {
    std::uint32_t node;
    double begin;
  };
  std::array<Waiting, 64> stack;  // the tree is balanced: 2^32 triangles are 32 deep
  std::size_t waiting = 0;
  const auto push = [&](const Waiting& one) {
    if (one.begin < kNever) stack[waiting++] = one;
  };
  push({0, enters(nodes_[0], reach)});
  while (waiting > 0) {
    const Waiting next = stack[--waiting];
    const double farthest = hit.triangle < 0 ? reach : hit.distance;
    if (next.begin * (1.0 - kShare) > farthest) continue;
    const Node& node = nodes_[next.node];
    if (node.count == 0) {
      Waiting one{next.node + 1, enters(nodes_[next.node + 1], farthest)};
      Waiting two{node.begin, enters(nodes_[node.begin], farthest)};
      if (two.begin < one.begin) std::swap(one, two);
      push(two);
      push(one);  // the nearer one next
      continue;
    }
    for (std::uint32_t k = node.begin; k < node.begin + node.count; ++k) {
      const std::uint32_t i = order_[k];
      add_hit(sighted(triangles_[i], from), static_cast<int>(i), along, reach, hit);
    }
    if (kAny && hit.triangle >= 0) return hit;
  }
  return hit;
}

RayHit TriangleTree::nearest(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double reach) const {
  return search<false>(origin, direction, reach);
}

bool TriangleTree::blocked(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double reach) const {
  return search<true>(origin, direction, reach).triangle >= 0;
}

}  // namespace roadfix
