#include "simulation/scene/street_line.h"

#include <cmath>
#include <stdexcept>

namespace roadfix {
namespace {

constexpr double kBefore_m = 60.0;
constexpr double kAfter_m = 300.0;
constexpr double kBeforeIndoors_m = 2.0;  // the same of a corridor, which is closed at its ends
constexpr double kAfterIndoors_m = 12.0;
constexpr double kSamePlace_m = 3.0;    // stations closer than this are one place ...
constexpr double kSameIndoors_m = 0.5;  // (in a corridor)
constexpr int kSamePlaceGap = 6;        // ... unless they follow each other ...
constexpr double kBeside_m = 1.0;       // ... or the earlier one, an end of the street, is still ahead
constexpr double kInLine_m = 0.5;       // a street that comes back to its own end joins it where it is
constexpr double kCell_m = 16.0;
constexpr double kTightest_m = 0.85;  // of the bend's radius

std::pair<int, int> cell_of(const Eigen::Vector3d& p) {
  return {static_cast<int>(std::floor(p.x() / kCell_m)), static_cast<int>(std::floor(p.y() / kCell_m))};
}

/// Points 1 m apart along the polyline.
std::vector<Eigen::Vector3d> resample(const std::vector<Eigen::Vector3d>& driven) {
  std::vector<Eigen::Vector3d> points;
  double left_over = 0.0;  // from the last point given to the next polyline corner
  for (std::size_t i = 0; i + 1 < driven.size(); ++i) {
    const Eigen::Vector3d step = driven[i + 1] - driven[i];
    const double length = step.norm();
    for (double at = points.empty() ? 0.0 : 1.0 - left_over; at <= length; at += 1.0) {
      points.emplace_back(driven[i] + step * (length > 0.0 ? at / length : 0.0));
      left_over = -at;
    }
    left_over += length;
  }
  if (points.size() < 2) throw std::invalid_argument("scene: a street needs a way of at least 2 m");
  return points;
}

Eigen::Vector3d level_direction(const Eigen::Vector3d& step) {
  return Eigen::Vector3d(step.x(), step.y(), 0.0).normalized();
}

/// Kind of the stretch at s and the distance to its nearer end; the last one has no end.
void set_kind(const std::vector<StreetSegment>& segments, Station& station) {
  std::size_t k = 0;
  while (k + 1 < segments.size() && segments[k + 1].begin_m <= station.s) ++k;
  station.kind = segments[k].kind;
  const double from_begin = k == 0 ? 1e3 : station.s - segments[k].begin_m;
  const double to_end = k + 1 < segments.size() ? segments[k + 1].begin_m - station.s : 1e3;
  station.inside = std::min(from_begin, to_end);
}

/// Whether `here` lies on the street of the earlier station.
bool same_place(const Station& earlier, const Station& here) {
  const Eigen::Vector2d d = (here.p - earlier.p).head<2>();
  const double radius = is_corridor(here.kind) ? kSameIndoors_m : kSamePlace_m;
  return d.norm() < radius && std::abs(d.dot(earlier.forward.head<2>())) < kBeside_m;
}

}  // namespace

Eigen::Vector3d Station::at(double t, double z) const {
  if (t * curvature > 0.0) t = std::copysign(std::min(std::abs(t), kTightest_m / std::abs(curvature)), t);
  return p + left * t + Eigen::Vector3d(0.0, 0.0, z);
}

StreetLine::StreetLine(const StreetPlan& plan) {
  if (plan.segments.empty() || plan.segments[0].begin_m != 0.0)
    throw std::invalid_argument("scene: the first segment of a street begins at 0");
  for (std::size_t i = 1; i < plan.segments.size(); ++i) {
    if (plan.segments[i].begin_m <= plan.segments[i - 1].begin_m)
      throw std::invalid_argument("scene: segments of a street must ascend");
  }
  std::vector<Eigen::Vector3d> points = resample(plan.driven);
  const std::size_t reach = std::min<std::size_t>(3, points.size() - 1);
  const Eigen::Vector3d start = points.front();
  const Eigen::Vector3d end = points.back();
  const Eigen::Vector3d out = level_direction(points[reach] - start);
  const Eigen::Vector3d on = level_direction(end - points[points.size() - 1 - reach]);
  std::vector<Eigen::Vector3d> all;
  const double before_m = is_corridor(plan.segments.front().kind) ? kBeforeIndoors_m : kBefore_m;
  const double after_m = is_corridor(plan.segments.back().kind) ? kAfterIndoors_m : kAfter_m;
  for (double d = before_m; d >= 1.0; d -= 1.0) all.emplace_back(start - d * out);
  all.insert(all.end(), points.begin(), points.end());
  for (double d = 1.0; d <= after_m; d += 1.0) all.emplace_back(end + d * on);
  const int n = static_cast<int>(all.size());
  const auto point = [&](int i) { return all[static_cast<std::size_t>(std::clamp(i, 0, n - 1))]; };
  for (int i = 0; i < n; ++i) {
    Station station;
    station.p = point(i);
    station.forward = level_direction(point(i + 2) - point(i - 2));
    station.left = Eigen::Vector3d::UnitZ().cross(station.forward);
    station.s = i - before_m;
    const Eigen::Vector3d before = level_direction(point(i) - point(i - 3));
    const Eigen::Vector3d after = level_direction(point(i + 3) - point(i));
    if (i >= 3 && i + 3 < n) station.curvature = std::atan2(before.cross(after).z(), before.dot(after)) / 3.0;
    set_kind(plan.segments, station);
    stations_.push_back(station);
  }
  find_repeats();
  // A corridor that ends in itself gets no arm through its own wall.
  const int last = n - 1 - static_cast<int>(after_m);
  if (!is_corridor((*this)[last].kind) || !(*this)[last].again) return;
  for (int i = last; i < n; ++i) stations_[static_cast<std::size_t>(i)].again = true;
}

void StreetLine::find_repeats() {
  for (int i = 0; i < size(); ++i) {
    Station& here = stations_[static_cast<std::size_t>(i)];
    const auto [cx, cy] = cell_of(here.p);
    int twin = -1;
    for (int x = cx - 1; x <= cx + 1; ++x) {
      for (int y = cy - 1; y <= cy + 1; ++y) {
        const auto found = grid_.find({x, y});
        if (found == grid_.end()) continue;
        for (const int j : found->second) {
          if (j < i - kSamePlaceGap && same_place((*this)[j], here)) twin = j;
        }
      }
    }
    grid_[{cx, cy}].push_back(i);
    here.again = twin >= 0;
    const bool joins = here.again && i > 0 && !(*this)[i - 1].again;
    if (!joins || std::abs((here.p - (*this)[twin].p).dot((*this)[twin].left)) > kInLine_m) continue;
    // The last piece of the street ends exactly where the earlier one begins.
    here.p = (*this)[twin].p;
    here.forward = std::copysign(1.0, here.forward.dot((*this)[twin].forward)) * (*this)[twin].forward;
    here.left = Eigen::Vector3d::UnitZ().cross(here.forward);
  }
}

bool StreetLine::passes(const Eigen::Vector3d& p, double radius, int except, int reach) const {
  const auto [cx, cy] = cell_of(p);
  const int cells = static_cast<int>(std::ceil(radius / kCell_m));
  for (int x = cx - cells; x <= cx + cells; ++x) {
    for (int y = cy - cells; y <= cy + cells; ++y) {
      const auto found = grid_.find({x, y});
      if (found == grid_.end()) continue;
      for (const int j : found->second) {
        if (reach > 0 && (std::abs(j - except) < reach || (*this)[j].again)) continue;
        if (((*this)[j].p - p).head<2>().norm() < radius) return true;
      }
    }
  }
  return false;
}

}  // namespace roadfix
