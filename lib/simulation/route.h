/// Where the simulated vehicle drives: straight pieces and smooth turns, and how fast it may.
///
/// A turn's curvature rises and falls as a sixth-order bump over its length, so heading and curvature are smooth; the
/// piece is symmetric, so a polygon of way points closes exactly.
#pragma once

#include <Eigen/Dense>
#include <vector>

namespace roadfix {

/// A point that the vehicle passes. At an inner point it turns to the next one within turn_length_m of path.
struct WayPoint {
  double east = 0.0;
  double north = 0.0;
  double turn_length = 20.0;       ///< m of path; zero where the road goes straight on
  double speed_limit = 14.0;       ///< m/s, from here on
  double stop_s = 0.0;             ///< stands this long here (a turn: before it)
  bool reverse_from_here = false;  ///< drives backwards to the next point; the direction changes only at a stop
};

struct Limits {
  double acceleration = 1.8;  ///< m/s2
  double braking = 2.2;       ///< m/s2
  double lateral = 2.5;       ///< m/s2
  double smoothing_s = 0.45;  ///< width of each of the three box filters over the distance travelled
};

/// One piece of path, in the order driven; `length` is travelled distance.
struct PathPiece {
  double length = 0.0;
  double turn = 0.0;  ///< rad, change of yaw
  double speed_limit = 0.0;
  double stop_s = 0.0;  ///< at its beginning
  int direction = 1;    ///< -1: backwards
};

struct Path {
  Eigen::Vector2d start = Eigen::Vector2d::Zero();
  double start_yaw = 0.0;  ///< rad, of the vehicle
  std::vector<PathPiece> pieces;
};

/// Fraction of a turn's angle that is done at fraction x of its length, and its derivative.
double turn_progress(double x);
double turn_rate(double x);

/// Throws std::invalid_argument where turns overlap or a direction changes without a stop.
Path path_through(const std::vector<WayPoint>& points);

/// Distance travelled at times 0, step_s, ... duration_s: within the limits, stopping where stop_s is set, then
/// smoothed. Where the path ends before the time, the vehicle stands at its end.
std::vector<double> travelled(const Path& path, const Limits& limits, double start_speed, double step_s, int count);

/// East, north and yaw at ascending distances.
std::vector<Eigen::Vector3d> poses_along(const Path& path, const std::vector<double>& distances);

}  // namespace roadfix
