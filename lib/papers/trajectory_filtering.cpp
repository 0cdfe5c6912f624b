#include "papers/trajectory_filtering.h"

#include <cmath>

namespace roadfix {

std::vector<FilteredPoint> filtered(const LiteralTrajectoryConfig& config, const std::vector<TrajectoryPoint>& points) {
  LiteralTrajectoryEkf ekf(config);
  std::vector<FilteredPoint> out;
  for (const TrajectoryPoint& point : points) {
    ekf.add(point.position);
    out.push_back({point.t_s, ekf.position(), ekf.covariance_trace()});
  }
  return out;
}

std::vector<FilteredPoint> filtered(const MotionTrajectoryConfig& config, const std::vector<TrajectoryPoint>& points) {
  MotionTrajectoryEkf ekf(config);
  std::vector<FilteredPoint> out;
  for (const TrajectoryPoint& point : points) {
    ekf.add(out.empty() ? 0.0 : point.t_s - out.back().t_s, point.position);
    out.push_back({point.t_s, ekf.position(), ekf.covariance_trace()});
  }
  return out;
}

std::optional<double> settling_time(const std::vector<FilteredPoint>& points, double rate) {
  if (points.size() < 2) return std::nullopt;
  std::size_t settled = points.size() - 1;
  for (; settled > 0; --settled) {
    const FilteredPoint &before = points[settled - 1], &after = points[settled];
    if (std::abs(after.trace - before.trace) >= rate * (after.t_s - before.t_s)) break;
  }
  if (settled + 1 == points.size()) return std::nullopt;
  return points[settled].t_s - points.front().t_s;
}

}  // namespace roadfix
