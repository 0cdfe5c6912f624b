#include "simulation/route.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include "geometry/frames.h"
#include "geometry/so3.h"

namespace roadfix {
namespace {

constexpr double kGrid = 0.25;  // m, step of the speed plan

/// Five-point Gauss-Legendre nodes and weights on [0, 1] (Abramowitz and Stegun, table 25.4).
constexpr std::array<double, 5> kNodes = {0.04691007703066800, 0.23076534494715845, 0.5, 0.76923465505284155,
                                          0.95308992296933200};
constexpr std::array<double, 5> kWeights = {0.11846344252809454, 0.23931433524968324, 0.28444444444444444,
                                            0.23931433524968324, 0.11846344252809454};

Eigen::Vector2d unit(double yaw) { return {std::cos(yaw), std::sin(yaw)}; }

/// Displacement from fraction a to fraction b of a piece that starts with the given yaw.
Eigen::Vector2d displacement(const PathPiece& piece, double yaw, double a, double b) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < kNodes.size(); ++i) {
    sum += kWeights[i] * unit(yaw + piece.turn * turn_progress(a + (b - a) * kNodes[i]));
  }
  return (b - a) * piece.length * piece.direction * sum;
}

/// Distance from the start of a turn to the corner that it rounds off.
double tangent_length(double length, double turn) {
  constexpr int kParts = 64;
  const PathPiece piece{length, turn, 0.0, 0.0, 1};
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (int i = 0; i < kParts; ++i) sum += displacement(piece, 0.0, double(i) / kParts, double(i + 1) / kParts);
  return sum.norm() / (2.0 * std::cos(turn / 2.0));
}

struct PlanNode {
  double distance = 0.0;
  double speed_squared = 0.0;
  double stop_s = 0.0;
};

/// Speed over distance: the limits of road and curvature first, then what braking and acceleration allow.
std::vector<PlanNode> plan_speed(const Path& path, const Limits& limits, double start_speed) {
  std::vector<PlanNode> plan;
  double begin = 0.0;
  for (const PathPiece& piece : path.pieces) {
    const int parts = std::max(1, static_cast<int>(std::ceil(piece.length / kGrid)));
    for (int i = 0; i < parts; ++i) {
      const double x = double(i) / parts;
      const double curvature = std::abs(piece.turn) / piece.length * turn_rate(x);
      double squared = piece.speed_limit * piece.speed_limit;
      if (curvature > 0.0) squared = std::min(squared, limits.lateral / curvature);
      const double stop_s = i == 0 ? piece.stop_s : 0.0;
      plan.push_back({begin + x * piece.length, stop_s > 0.0 ? 0.0 : squared, stop_s});
    }
    begin += piece.length;
  }
  plan.push_back({begin, 0.0, 0.0});
  if (plan.front().stop_s == 0.0) plan.front().speed_squared = start_speed * start_speed;
  for (std::size_t i = 1; i < plan.size(); ++i) {
    const double length = plan[i].distance - plan[i - 1].distance;
    plan[i].speed_squared =
        std::min(plan[i].speed_squared, plan[i - 1].speed_squared + 2.0 * limits.acceleration * length);
  }
  for (std::size_t i = plan.size() - 1; i-- > 1;) {
    const double length = plan[i + 1].distance - plan[i].distance;
    plan[i].speed_squared = std::min(plan[i].speed_squared, plan[i + 1].speed_squared + 2.0 * limits.braking * length);
  }
  return plan;
}

/// Distance at uniform times; between two nodes the acceleration is constant.
std::vector<double> sample_plan(const std::vector<PlanNode>& plan, double step_s, int count) {
  std::vector<double> distance;
  distance.reserve(static_cast<std::size_t>(count));
  double node_time = plan.front().stop_s;
  std::size_t node = 0;
  for (int i = 0; i < count; ++i) {
    const double t = i * step_s;
    while (node + 1 < plan.size()) {
      const double v0 = std::sqrt(plan[node].speed_squared);
      const double v1 = std::sqrt(plan[node + 1].speed_squared);
      const double length = plan[node + 1].distance - plan[node].distance;
      const double taken = 2.0 * length / (v0 + v1) + plan[node + 1].stop_s;
      if (t < node_time + taken) break;
      node_time += taken;
      ++node;
    }
    if (node + 1 == plan.size() || t <= node_time) {
      distance.push_back(plan[node].distance);
      continue;
    }
    const double length = plan[node + 1].distance - plan[node].distance;
    const double v0 = std::sqrt(plan[node].speed_squared);
    const double acceleration = (plan[node + 1].speed_squared - plan[node].speed_squared) / (2.0 * length);
    const double dt = t - node_time;
    const double moving = 2.0 * length / (v0 + std::sqrt(plan[node + 1].speed_squared));
    distance.push_back(dt >= moving ? plan[node + 1].distance
                                    : plan[node].distance + dt * (v0 + 0.5 * acceleration * dt));
  }
  return distance;
}

/// Running mean over 2 half + 1 samples; the ends are taken to go on straight (point reflection).
std::vector<double> box_filtered(const std::vector<double>& in, int half) {
  const auto n = static_cast<int>(in.size());
  const auto at = [&](int i) {
    if (i < 0) return 2.0 * in.front() - in[static_cast<std::size_t>(std::min(-i, n - 1))];
    if (i >= n) return 2.0 * in.back() - in[static_cast<std::size_t>(std::max(2 * n - 2 - i, 0))];
    return in[static_cast<std::size_t>(i)];
  };
  std::vector<double> out(in.size());
  for (int i = 0; i < n; ++i) {
    // Differences from the middle value, so that equal values stay exactly equal.
    double sum = 0.0;
    for (int j = -half; j <= half; ++j) sum += at(i + j) - at(i);
    out[static_cast<std::size_t>(i)] = at(i) + sum / (2 * half + 1);
  }
  return out;
}

}  // namespace

// Integral of 140 x^3 (1 - x)^3, which is zero with two derivatives at both ends.
double turn_progress(double x) {
  const double x4 = x * x * x * x;
  return x4 * (35.0 + x * (-84.0 + x * (70.0 - 20.0 * x)));
}

double turn_rate(double x) {
  const double y = x * (1.0 - x);
  return 140.0 * y * y * y;
}

Path path_through(const std::vector<WayPoint>& points) {
  if (points.size() < 2) throw std::invalid_argument("simulation: a route needs two way points");
  const auto chord = [&](std::size_t i) {
    return Eigen::Vector2d(points[i + 1].east - points[i].east, points[i + 1].north - points[i].north);
  };
  const auto yaw_of_leg = [&](std::size_t i) {
    const Eigen::Vector2d d = chord(i);
    return std::atan2(d.y(), d.x()) + (points[i].reverse_from_here ? kPi : 0.0);
  };
  Path path;
  path.start = {points[0].east, points[0].north};
  path.start_yaw = yaw_of_leg(0);
  double used = 0.0;  // of the leg, by the turn before it
  for (std::size_t i = 0; i + 1 < points.size(); ++i) {
    const int direction = points[i].reverse_from_here ? -1 : 1;
    const bool last = i + 2 == points.size();
    double turn = 0.0;
    double tangent = 0.0;
    if (!last) {
      turn = wrap_angle(yaw_of_leg(i + 1) - yaw_of_leg(i));
      const bool cusp = points[i].reverse_from_here != points[i + 1].reverse_from_here;
      if (cusp && (points[i + 1].stop_s <= 0.0 || std::abs(turn) > 1e-9)) {
        throw std::invalid_argument("simulation: a change of direction needs a stop and no turn");
      }
      if (std::abs(turn) > 1e-9) tangent = tangent_length(points[i + 1].turn_length, turn);
    }
    const double straight = chord(i).norm() - used - tangent;
    if (straight <= 0.0) throw std::invalid_argument("simulation: turns of a route overlap");
    const double stop_here = used > 0.0 ? 0.0 : points[i].stop_s;
    path.pieces.push_back({straight, 0.0, points[i].speed_limit, stop_here, direction});
    if (tangent > 0.0) {
      path.pieces.push_back({points[i + 1].turn_length, turn, points[i].speed_limit, points[i + 1].stop_s, direction});
    }
    used = tangent;
  }
  return path;
}

std::vector<double> travelled(const Path& path, const Limits& limits, double start_speed, double step_s, int count) {
  std::vector<double> distance = sample_plan(plan_speed(path, limits, start_speed), step_s, count);
  const int half = static_cast<int>(std::lround(0.5 * limits.smoothing_s / step_s));
  for (int pass = 0; pass < 3; ++pass) distance = box_filtered(distance, half);
  return distance;
}

std::vector<Eigen::Vector3d> poses_along(const Path& path, const std::vector<double>& distances) {
  std::vector<Eigen::Vector3d> poses;
  poses.reserve(distances.size());
  std::size_t index = 0;
  double begin = 0.0;           // of the piece
  double reached = 0.0;         // fraction of the piece
  double yaw = path.start_yaw;  // at the beginning of the piece
  Eigen::Vector2d p = path.start;
  for (const double distance : distances) {
    while (index + 1 < path.pieces.size() && distance > begin + path.pieces[index].length) {
      const PathPiece& piece = path.pieces[index];
      p += displacement(piece, yaw, reached, 1.0);
      yaw += piece.turn;
      begin += piece.length;
      reached = 0.0;
      ++index;
    }
    const PathPiece& piece = path.pieces[index];
    const double fraction = (distance - begin) / piece.length;
    if (fraction > reached || (index == 0 && fraction < 0.0)) {
      p += displacement(piece, yaw, reached, fraction);
      reached = fraction;
    }
    const double progress = turn_progress(std::clamp(reached, 0.0, 1.0));
    poses.emplace_back(p.x(), p.y(), yaw + piece.turn * progress);
  }
  return poses;
}

}  // namespace roadfix
