/// Any ray against many triangles: a tree of boxes, halved at the median, in doubles. Its boxes are wider than rounding,
/// so that the tree only proposes, and triangle.h decides.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "simulation/scene/triangle.h"

namespace roadfix {

class TriangleTree {
 public:
  TriangleTree() = default;
  /// The triangles outlive the tree, and stay where they are.
  explicit TriangleTree(std::span<const Triangle> triangles);

  /// What a ray hits first within `reach` lengths of its direction.
  [[nodiscard]] RayHit nearest(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double reach) const;
  /// Whether it hits anything there.
  [[nodiscard]] bool blocked(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double reach) const;

 private:
  struct Node {
    std::array<double, 3> low, high;
    std::uint32_t begin;  ///< of a leaf's triangles; otherwise the second child, the first one follows its parent
    std::uint32_t count;  ///< of a leaf; 0 otherwise
  };
  std::uint32_t build(std::span<std::uint32_t> part);
  template <bool kAny>
  [[nodiscard]] RayHit search(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double reach) const;

  std::span<const Triangle> triangles_;
  std::vector<Eigen::Vector3f> middles_;  ///< while it is built
  std::vector<std::uint32_t> order_;
  std::vector<Node> nodes_;
};

}  // namespace roadfix
