#include "simulation/scene/tiles.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace roadfix {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kNearest_m = 1e-3F;  // depth before which nothing is seen
constexpr float kRounding = 4e-6F;   // of products of coordinates in floats, with a margin
constexpr float kFarthest_m = 1e6F;  // depth; nothing is there
constexpr float kShare = 1e-5F;      // margin of depths

struct Interval {
  float low = kInfinity;
  float high = -kInfinity;
  void add(float x) {
    low = std::min(low, x);
    high = std::max(high, x);
  }
};

/// Bounds of a x + b y + c over a tile.
float highest(const Float3& f, const TileGrid::Bounds& t) {
  return std::max(f[0] * t.x0, f[0] * t.x1) + std::max(f[1] * t.y0, f[1] * t.y1) + f[2];
}
float lowest(const Float3& f, const TileGrid::Bounds& t) {
  return std::min(f[0] * t.x0, f[0] * t.x1) + std::min(f[1] * t.y0, f[1] * t.y1) + f[2];
}

}  // namespace

TileGrid::TileGrid(int width, int height, const std::vector<float>& ray_x, const std::vector<float>& ray_y)
    : columns_((width + kWidth - 1) / kWidth), rows_((height + kHeight - 1) / kHeight) {
  const auto stride = static_cast<std::size_t>(width) + 2;
  const Bounds none{kInfinity, -kInfinity, kInfinity, -kInfinity};
  const auto widen = [](Bounds& b, const Bounds& by) {
    b = {std::min(b.x0, by.x0), std::max(b.x1, by.x1), std::min(b.y0, by.y0), std::max(b.y1, by.y1)};
  };
  picture_ = none;
  left_.assign(static_cast<std::size_t>(columns_), kInfinity);
  right_.assign(static_cast<std::size_t>(columns_), -kInfinity);
  top_.assign(static_cast<std::size_t>(rows_), kInfinity);
  bottom_.assign(static_cast<std::size_t>(rows_), -kInfinity);
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      Bounds b = none;
      for (int v = row * kHeight; v < std::min(height, (row + 1) * kHeight) + 2; ++v) {
        for (int u = column * kWidth; u < std::min(width, (column + 1) * kWidth) + 2; ++u) {
          const std::size_t at = static_cast<std::size_t>(v) * stride + static_cast<std::size_t>(u);
          widen(b, {ray_x[at], ray_x[at], ray_y[at], ray_y[at]});
        }
      }
      tiles_.push_back(b);
      widen(picture_, b);
      const auto c = static_cast<std::size_t>(column);
      const auto r = static_cast<std::size_t>(row);
      left_[c] = std::min(left_[c], b.x0);
      right_[c] = std::max(right_[c], b.x1);
      top_[r] = std::min(top_[r], b.y0);
      bottom_[r] = std::max(bottom_[r], b.y1);
    }
  }
  // A lens may bend lines so that they do not ascend by themselves.
  for (auto* ends : {&right_, &bottom_})
    std::partial_sum(ends->begin(), ends->end(), ends->begin(), [](float a, float b) { return std::max(a, b); });
  for (auto* begins : {&left_, &top_})
    std::partial_sum(begins->rbegin(), begins->rend(), begins->rbegin(),
                     [](float a, float b) { return std::min(a, b); });
}

TileGrid::Range TileGrid::between(float low, float high, const std::vector<float>& begin,
                                  const std::vector<float>& end) {
  return {static_cast<int>(std::lower_bound(end.begin(), end.end(), low) - end.begin()),
          static_cast<int>(std::upper_bound(begin.begin(), begin.end(), high) - begin.begin()) - 1};
}

TileLists::TileLists(const TileGrid& grid, const RayWindow& window, const Eigen::Matrix3f& R,
                     const Eigen::Vector3f& eye)
    : grid_(grid), window_(window), eye_(eye), rows_(static_cast<std::size_t>(grid.rows())) {
  const TileGrid::Bounds& all = grid.picture();
  const float x = std::max(std::abs(all.x0), std::abs(all.x1));
  const float y = std::max(std::abs(all.y0), std::abs(all.y1));
  longest_ = 1.0001F * std::sqrt(x * x + y * y + 1.0F);
  const Eigen::Matrix3f R_camera_enu = R.transpose();
  const auto& corners = window.corners();
  for (std::uint32_t face = 0; face < corners.size(); ++face) {
    std::array<Eigen::Vector3f, 4> p;
    for (std::size_t k = 0; k < 4; ++k)
      p[k] = R_camera_enu * (Eigen::Map<const Eigen::Vector3f>(corners[face][k].data()) - eye);
    look_at(face, p);
  }
  std::sort(seen_.begin(), seen_.end(), [](const Seen& a, const Seen& b) {
    return a.nearest != b.nearest ? a.nearest < b.nearest : a.triangle < b.triangle;
  });
}

void TileLists::look_at(std::uint32_t face, const std::array<Eigen::Vector3f, 4>& p) {
  // Outside of one of the planes around the picture's rays?
  const TileGrid::Bounds& all = grid_.picture();
  const auto every = [&p](const auto& outside) {
    return outside(p[0]) && outside(p[1]) && outside(p[2]) && outside(p[3]);
  };
  if (every([](const auto& q) { return q.z() < kNearest_m; }) ||
      every([&](const auto& q) { return q.x() < all.x0 * q.z(); }) ||
      every([&](const auto& q) { return q.x() > all.x1 * q.z(); }) ||
      every([&](const auto& q) { return q.y() < all.y0 * q.z(); }) ||
      every([&](const auto& q) { return q.y() > all.y1 * q.z(); }))
    return;
  add_triangle(2 * face, p[0], p[1], p[3]);
  add_triangle(2 * face + 1, p[2], p[3], p[1]);
}

void TileLists::add_triangle(std::uint32_t triangle, const Eigen::Vector3f& a, const Eigen::Vector3f& b,
                             const Eigen::Vector3f& c) {
  const Eigen::Vector3f* const corner[3] = {&a, &b, &c};
  Interval x;
  Interval y;
  Interval z;
  const auto project = [&](const Eigen::Vector3f& p) {
    x.add(p.x() / p.z());
    y.add(p.y() / p.z());
    z.add(p.z());
  };
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3f& p = *corner[k];
    const Eigen::Vector3f& q = *corner[(k + 1) % 3];
    if (p.z() >= kNearest_m) project(p);
    if ((p.z() < kNearest_m) != (q.z() < kNearest_m)) {
      const Eigen::Vector3f on = p + (kNearest_m - p.z()) / (q.z() - p.z()) * (q - p);
      project({on.x(), on.y(), kNearest_m});
    }
  }
  if (z.low > z.high) return;
  Seen s{};
  s.columns = grid_.columns_between(x.low, x.high);
  s.rows = grid_.rows_between(y.low, y.high);
  if (s.columns.last < s.columns.first || s.rows.last < s.rows.first) return;
  s.triangle = triangle;
  s.nearest = z.low * (1.0F - kShare);
  const Eigen::Vector3f ab = b - a;
  const Eigen::Vector3f ac = c - a;
  const Eigen::Vector3f normal = ab.cross(ac);
  const float det = normal.dot(a);
  const float reach = std::max({a.norm(), b.norm(), c.norm()});
  const float uncertainty = kRounding * reach * (ab.norm() + ac.norm()) / std::abs(det);  // of normal / det
  s.has_edges = uncertainty * reach < 0.05F;                                              // not seen edge on
  const float towards = det < 0.0F ? -1.0F : 1.0F;
  for (int k = 0; s.has_edges && k < 3; ++k) {
    const Eigen::Vector3f& p = *corner[k];
    const Eigen::Vector3f& q = *corner[(k + 1) % 3];
    const Eigen::Vector3f n = towards * p.cross(q);
    const float rounding = kRounding * p.norm() * q.norm();
    s.edge[k] = {n.x(), n.y(), n.z() + rounding};
    s.slack[k] = 2.0F * rounding;
  }
  for (Eigen::Index k = 0; k < 3; ++k) s.inverse_depth[static_cast<std::size_t>(k)] = normal[k] / det;
  s.depth_slack = 2.0F * uncertainty + kRounding * normal.cwiseAbs().sum() / std::abs(det);
  const Float3& first = window_.triangles()[triangle].corner[0];
  s.from_eye = {first[0] - eye_.x(), first[1] - eye_.y(), first[2] - eye_.z()};
  s.length = 1.0001F *
             std::sqrt(s.from_eye[0] * s.from_eye[0] + s.from_eye[1] * s.from_eye[1] + s.from_eye[2] * s.from_eye[2]);
  seen_.push_back(s);
}

void TileLists::fill(int row) {
  constexpr std::uint32_t kEnd = ~0U;
  struct Link {
    Entry entry;
    std::uint32_t next;
  };
  const auto columns = static_cast<std::size_t>(grid_.columns());
  std::vector<Link> links;
  std::vector<std::uint32_t> newest(columns, kEnd);
  std::vector<float> filled_at(columns, kInfinity);  // depth behind which nothing of a tile is seen
  for (std::uint32_t i = 0; i < seen_.size(); ++i) {
    const Seen& s = seen_[i];
    if (row < s.rows.first || row > s.rows.last) continue;
    for (int column = s.columns.first; column <= s.columns.last; ++column) {
      const auto k = static_cast<std::size_t>(column);
      if (s.nearest > filled_at[k]) continue;
      Entry entry{s.nearest, i};
      if (s.has_edges) {
        const TileGrid::Bounds& tile = grid_(column, row);
        if (highest(s.edge[0], tile) < 0.0F || highest(s.edge[1], tile) < 0.0F || highest(s.edge[2], tile) < 0.0F)
          continue;
        const float nearest = (1.0F - kShare) / (highest(s.inverse_depth, tile) + s.depth_slack);
        if (nearest > entry.nearest) entry.nearest = nearest;
        if (entry.nearest > filled_at[k]) continue;
        const float farthest = (1.0F + kShare) / (lowest(s.inverse_depth, tile) - s.depth_slack);
        if (farthest > 0.0F && farthest < filled_at[k] && lowest(s.edge[0], tile) > s.slack[0] &&
            lowest(s.edge[1], tile) > s.slack[1] && lowest(s.edge[2], tile) > s.slack[2])
          filled_at[k] = farthest;
      }
      links.push_back({entry, newest[k]});
      newest[k] = static_cast<std::uint32_t>(links.size() - 1);
    }
  }
  Row& out = rows_[static_cast<std::size_t>(row)];
  out.entries.clear();
  out.begin.assign(1, 0);
  for (std::size_t k = 0; k < columns; ++k) {
    for (std::uint32_t at = newest[k]; at != kEnd; at = links[at].next) {
      if (links[at].entry.nearest <= filled_at[k]) out.entries.push_back(links[at].entry);
    }
    std::sort(out.entries.begin() + out.begin.back(), out.entries.end(), [](const Entry& a, const Entry& b) {
      return a.nearest != b.nearest ? a.nearest < b.nearest : a.seen < b.seen;
    });
    out.begin.push_back(static_cast<std::uint32_t>(out.entries.size()));
  }
}

void TileLists::search(int row, int column, const Lanes3& direction, Nearest& nearest) const {
  const Row& list = rows_[static_cast<std::size_t>(row)];
  const auto k = static_cast<std::size_t>(column);
  float farthest = largest(nearest.far) * (1.0F + kShare);
  for (std::uint32_t at = list.begin[k]; at < list.begin[k + 1]; ++at) {
    const Entry& entry = list.entries[at];
    if (entry.nearest > farthest) break;
    const Seen& s = seen_[entry.seen];
    const Proposal hit =
        propose(window_.triangles()[s.triangle], splat(s.from_eye), splat(s.length), direction, longest_, nearest.far);
    nearest.uncertain |= hit.possible & ~hit.certain;
    if (!any(hit.certain)) continue;
    const auto triangle = static_cast<std::int32_t>(s.triangle);
    const I8 before = hit.certain & (hit.far < nearest.near);
    const I8 beside = hit.certain & ~before & (hit.near <= nearest.far) & (nearest.triangle != triangle);
    nearest.uncertain |= beside;
    nearest.triangle = select(before, I8{} + triangle, nearest.triangle);
    nearest.near = select(before | beside, min(hit.near, nearest.near), nearest.near);
    nearest.far = select(before | beside, min(hit.far, nearest.far), nearest.far);
    farthest = largest(nearest.far) * (1.0F + kShare);
  }
}

int TileLists::decide(int row, int column, const std::array<double, 3>& direction) const {
  const Row& list = rows_[static_cast<std::size_t>(row)];
  const auto k = static_cast<std::size_t>(column);
  RayHit hit{-1, static_cast<double>(kFarthest_m)};
  for (std::uint32_t at = list.begin[k]; at < list.begin[k + 1]; ++at) {
    const Entry& entry = list.entries[at];
    if (entry.nearest > hit.distance * (1.0 + kShare)) break;
    const auto i = seen_[entry.seen].triangle;
    add_hit(sighted(window_.triangles()[i], {eye_.x(), eye_.y(), eye_.z()}), static_cast<int>(i), direction,
            kFarthest_m, hit);
  }
  return hit.triangle;
}

namespace {

D4 half_of(const F8& x, int half) {
  const int i = 4 * half;
  return D4{x[i], x[i + 1], x[i + 2], x[i + 3]};
}

}  // namespace

HitLanes TileLists::hits(I8 triangle, const Lanes3& direction) const {
  HitLanes hit{triangle >> 1, splat(kInfinity), splat(0.0F), splat(0.0F)};  // -1 stays
  I8 left = triangle >= 0;
  for (int i = 0; i < kLanes; ++i) {
    if (left[i] == 0) continue;
    const I8 here = triangle == triangle[i];
    const SightedTriangle t =
        sighted(window_.triangles()[static_cast<std::size_t>(triangle[i])], {eye_.x(), eye_.y(), eye_.z()});
    for (int half = 0; half < 2; ++half) {
      const auto p = products(t, half_of(direction.x, half), half_of(direction.y, half), half_of(direction.z, half));
      const D4 distance = t.height / p.along;
      D4 u;
      D4 v;
      place_on_face(p, (triangle[i] & 1) != 0, u, v);
      for (int k = 0; k < 4; ++k) {
        const int lane = 4 * half + k;
        if (here[lane] == 0) continue;
        hit.distance[lane] = static_cast<float>(distance[k]);
        hit.u[lane] = static_cast<float>(u[k]);
        hit.v[lane] = static_cast<float>(v[k]);
      }
    }
    left &= ~here;
  }
  return hit;
}

HitLanes TileLists::intersect(int row, std::array<int, 2> columns, const Lanes3& direction) const {
  Nearest nearest{I8{} - 1, splat(kFarthest_m), splat(kFarthest_m), I8{}};
  search(row, columns[0], direction, nearest);
  if (columns[1] != columns[0]) search(row, columns[1], direction, nearest);
  for (int i = 0; any(nearest.uncertain) && i < kLanes; ++i) {
    if (nearest.uncertain[i] == 0) continue;
    nearest.triangle[i] =
        decide(row, columns[static_cast<std::size_t>(i / 4)], {direction.x[i], direction.y[i], direction.z[i]});
  }
  return hits(nearest.triangle, direction);
}

}  // namespace roadfix
