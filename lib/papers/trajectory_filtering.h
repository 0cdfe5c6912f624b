/// Kim and Kang's (2025) filters over a whole recorded trajectory: positions, and the trace of the covariance over time (their
/// figure 8). MODEL.md, section 1.
#pragma once

#include <optional>
#include <vector>

#include "papers/trajectory_ekf.h"

namespace roadfix {

struct TrajectoryPoint {
  double t_s = 0.0;
  Eigen::Vector2d position = Eigen::Vector2d::Zero();  ///< m
};

struct FilteredPoint {
  double t_s = 0.0;
  Eigen::Vector2d position = Eigen::Vector2d::Zero();
  double trace = 0.0;  ///< m2, of the position's covariance
};

/// Points in order of time, each later than the one before.
std::vector<FilteredPoint> filtered(const LiteralTrajectoryConfig& config, const std::vector<TrajectoryPoint>& points);
std::vector<FilteredPoint> filtered(const MotionTrajectoryConfig& config, const std::vector<TrajectoryPoint>& points);

/// Time from the first point until the trace changes by less than `rate` (m2/s; theirs is 0.01) from there on. Nothing where it
/// never does, or there are fewer than two points.
std::optional<double> settling_time(const std::vector<FilteredPoint>& points, double rate = 0.01);

}  // namespace roadfix
