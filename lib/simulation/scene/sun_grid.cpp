#include "simulation/scene/sun_grid.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace roadfix {
namespace {

constexpr double kMargin_m = 0.01;  // far above the rounding of floats within a window
constexpr float kUnit = 1.0001F;    // length of the direction to the sun, at most
constexpr float kInfinity = std::numeric_limits<float>::infinity();

Eigen::Vector3d vector(const Float3& x) { return {x[0], x[1], x[2]}; }
Float3 floats(const Eigen::Vector3d& x) {
  return {static_cast<float>(x.x()), static_cast<float>(x.y()), static_cast<float>(x.z())};
}
F8 along(const Float3& axis, const Lanes3& p) { return axis[0] * p.x + axis[1] * p.y + axis[2] * p.z; }

std::array<Eigen::Vector3d, 3> corners_of(const Triangle& t) {
  const Eigen::Vector3d a = vector(t.corner[0]);
  return {a, vector(t.corner[1]), vector(t.corner[2])};
}

}  // namespace

SunGrid::SunGrid(const Float3& to_sun, std::vector<Triangle> triangles, double cell_m)
    : to_sun_(to_sun), cells_per_m_(static_cast<float>(1.0 / cell_m)), triangles_(std::move(triangles)) {
  if (triangles_.empty()) return;
  choose_grid(cell_m);
  begin_.assign(static_cast<std::size_t>(size_[0]) * static_cast<std::size_t>(size_[1]) + 1, 0);
  for (const Triangle& t : triangles_) for_cells(t, [&](std::size_t cell, float) { ++begin_[cell + 1]; });
  for (std::size_t k = 1; k < begin_.size(); ++k) begin_[k] += begin_[k - 1];
  entries_.resize(begin_.back());
  std::vector<std::uint32_t> next(begin_.begin(), begin_.end() - 1);
  for (std::uint32_t i = 0; i < triangles_.size(); ++i)
    for_cells(triangles_[i], [&](std::size_t cell, float top) { entries_[next[cell]++] = {top, i}; });
  for (std::size_t k = 0; k + 1 < begin_.size(); ++k) {
    std::sort(entries_.begin() + begin_[k], entries_.begin() + begin_[k + 1],
              [](const Entry& a, const Entry& b) { return a.top != b.top ? a.top > b.top : a.triangle < b.triangle; });
  }
}

void SunGrid::choose_grid(double cell_m) {
  const Eigen::Vector3d sun = vector(to_sun_);
  across_[0] = floats(sun.unitOrthogonal());
  across_[1] = floats(sun.cross(vector(across_[0])));
  for (int k = 0; k < 2; ++k) {
    double low = std::numeric_limits<double>::infinity();
    double high = -low;
    for (const Triangle& t : triangles_) {
      for (const auto& p : corners_of(t)) {
        const double x = vector(across_[k]).dot(p);
        low = std::min(low, x);
        high = std::max(high, x);
      }
    }
    begin_m_[k] = static_cast<float>(low - 2.0 * kMargin_m);
    size_[k] = static_cast<int>((high - low + 4.0 * kMargin_m) / cell_m) + 1;
  }
}

template <class Use>
void SunGrid::for_cells(const Triangle& triangle, Use use) const {
  // Axes across the sun's rays in cells, and along them in m.
  Eigen::Vector3d p[3];
  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector3d high = -low;
  const auto corners = corners_of(triangle);
  for (std::size_t k = 0; k < 3; ++k) {
    p[k] = {(vector(across_[0]).dot(corners[k]) - begin_m_[0]) * cells_per_m_,
            (vector(across_[1]).dot(corners[k]) - begin_m_[1]) * cells_per_m_, vector(to_sun_).dot(corners[k])};
    low = low.cwiseMin(p[k]);
    high = high.cwiseMax(p[k]);
  }
  const double margin = kMargin_m * cells_per_m_;
  const Eigen::Vector3d n = (p[1] - p[0]).cross(p[2] - p[0]);
  const bool upright = std::abs(n.z()) < 1e-6;  // a line in the grid
  const double turn = n.z() < 0.0 ? -1.0 : 1.0;
  const auto cell_at = [&](double x, int k) { return std::clamp(static_cast<int>(x), 0, size_[k] - 1); };
  for (int row = cell_at(low.y() - margin, 1); row <= cell_at(high.y() + margin, 1); ++row) {
    for (int column = cell_at(low.x() - margin, 0); column <= cell_at(high.x() + margin, 0); ++column) {
      // The largest value of gx x + gy y over the cell with its margin.
      const auto highest = [&](double gx, double gy) {
        return gx * (column + 0.5) + gy * (row + 0.5) + (0.5 + margin) * (std::abs(gx) + std::abs(gy));
      };
      bool outside = false;
      for (int k = 0; !upright && k < 3; ++k) {
        const Eigen::Vector3d edge = turn * (p[(k + 1) % 3] - p[k]);
        outside |= highest(-edge.y(), edge.x()) < edge.x() * p[k].y() - edge.y() * p[k].x();
      }
      if (outside) continue;
      double top = high.z();
      if (!upright) {
        const double gx = -n.x() / n.z();
        const double gy = -n.y() / n.z();
        top = std::min(top, p[0].z() + highest(gx, gy) - gx * p[0].x() - gy * p[0].y());
      }
      use(static_cast<std::size_t>(row) * static_cast<std::size_t>(size_[0]) + static_cast<std::size_t>(column),
          static_cast<float>(top + kMargin_m));
    }
  }
}

bool SunGrid::blocked(std::size_t cell, const Float3& point, float height, float reach_m) const {
  const std::array<double, 3> from{point[0], point[1], point[2]};
  RayHit hit;
  for (std::uint32_t at = begin_[cell]; at < begin_[cell + 1] && entries_[at].top >= height; ++at) {
    const std::uint32_t i = entries_[at].triangle;
    add_hit(sighted(triangles_[i], from), static_cast<int>(i), {to_sun_[0], to_sun_[1], to_sun_[2]}, reach_m, hit);
    if (hit.triangle >= 0) return true;
  }
  return false;
}

I8 SunGrid::shaded(const Lanes3& point, I8 active, float reach_m) const {
  I8 dark{};
  if (triangles_.empty()) return dark;
  const F8 x = (along(across_[0], point) - begin_m_[0]) * cells_per_m_;
  const F8 y = (along(across_[1], point) - begin_m_[1]) * cells_per_m_;
  const I8 over_grid =
      active & (x >= 0.0F) & (y >= 0.0F) & (x < static_cast<float>(size_[0])) & (y < static_cast<float>(size_[1]));
  if (!any(over_grid)) return dark;
  const F8 height = along(to_sun_, point);
  const I8 cell = to_int(select(over_grid, y, splat(0.0F))) * size_[0] + to_int(select(over_grid, x, splat(0.0F)));
  const Lanes3 sun = splat(to_sun_);
  I8 left = over_grid;
  I8 uncertain{};
  for (int i = 0; i < kLanes; ++i) {
    if (left[i] == 0) continue;
    const auto k = static_cast<std::size_t>(cell[i]);
    const I8 here = left & (cell == cell[i]);
    const float lowest = smallest(select(here, height, splat(kInfinity)));
    for (std::uint32_t at = begin_[k]; at < begin_[k + 1] && entries_[at].top >= lowest; ++at) {
      const Triangle& t = triangles_[entries_[at].triangle];
      const Float3& corner = t.corner[0];
      const Lanes3 from_point{corner[0] - point.x, corner[1] - point.y, corner[2] - point.z};
      const F8 length = abs(from_point.x) + abs(from_point.y) + abs(from_point.z);
      const Proposal hit = propose(t, from_point, length, sun, kUnit, splat(reach_m));
      const I8 certain = hit.certain & (hit.far <= reach_m);
      uncertain |= hit.possible & ~certain & here;
      dark |= certain & here;
      if (!any(here & ~dark)) break;
    }
    left &= ~here;
  }
  uncertain &= ~dark;
  if (!any(uncertain)) return dark;
  for (int i = 0; i < kLanes; ++i) {
    if (uncertain[i] == 0) continue;
    const Float3 at{point.x[i], point.y[i], point.z[i]};
    if (blocked(static_cast<std::size_t>(cell[i]), at, height[i], reach_m)) dark[i] = -1;
  }
  return dark;
}

}  // namespace roadfix
