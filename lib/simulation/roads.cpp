// The roads of the scenarios (scenarios.h): way points and terrain.
#include <algorithm>
#include <cmath>

#include "geometry/frames.h"
#include "simulation/random.h"
#include "simulation/scenarios.h"

namespace roadfix {
namespace {

using Points = std::vector<WayPoint>;

/// Blocks around a corner lot: seven corners, one of them a right turn among left ones; a stop at two of them.
Points city_loop(double duration_s) {
  const Points lap = {{0, 0, 20, 13.9, 0, false},  {180, 0, 22, 13.9, 0, false},   {180, 90, 18, 11, 6, false},
                      {260, 90, 18, 12, 0, false}, {260, 210, 20, 13.9, 0, false}, {60, 210, 22, 11, 9, false},
                      {60, 130, 18, 10, 0, false}, {-70, 130, 20, 12, 0, false},   {-70, 0, 20, 13.9, 0, false}};
  const int laps = 2 + static_cast<int>(duration_s / 60.0);
  Points points = {{-40, 0, 20, 13.9, 3, false}};
  for (int i = 0; i < laps; ++i) points.insert(points.end(), lap.begin(), lap.end());
  return points;
}

Points bends(double duration_s, double speed, double leg, double turn_length, double stop_s) {
  // Changes of heading in turn, degrees: no two bends of a drive of some minutes are alike.
  static constexpr double kBends[] = {28, -35, 17, 40, -22, -31, 36, -14, 25, -38};
  Points points = {{0, 0, turn_length, speed, stop_s, false}};
  double heading = 20.0 * kDegree;
  const int legs = 3 + static_cast<int>(duration_s * speed / leg);
  for (int i = 0; i < legs; ++i) {
    const double length = leg * (i % 3 == 1 ? 1.3 : 1.0);
    const WayPoint& last = points.back();
    points.push_back({last.east + length * std::cos(heading), last.north + length * std::sin(heading), turn_length,
                      speed, 0.0, false});
    heading += kBends[i % 10] * kDegree;
  }
  return points;
}

/// Along an aisle, backwards into a bay, out again, around the end of the aisle, and once more.
Points car_park(double duration_s) {
  Points points = {{-10, 0, 16, 4, 3, false}};
  const int rounds = 1 + static_cast<int>(duration_s / 45.0);
  for (int i = 0; i < rounds; ++i) {
    const Points round = {{45, 0, 16, 2, 2, true},    {25, 0, 16, 2, 0, true},     {25, 16, 16, 3, 5, false},
                          {25, -25, 16, 4, 0, false}, {-30, -25, 16, 4, 0, false}, {-30, 0, 16, 4, 0, false}};
    points.insert(points.end(), round.begin(), round.end());
  }
  points.push_back({45, 0, 16, 4, 0, false});
  return points;
}

/// A walk over a grid of streets that never turns back and stays within a square of 2.4 km.
Points long_city(double duration_s) {
  constexpr double kBlock = 130.0;
  constexpr double kHalfSize = 1200.0;
  RandomStream random(1, 1);  // the streets are the same in every drive
  Points points = {{0, 0, 20, 13.9, 4, false}};
  int quarter = 0;
  const int legs = 4 + static_cast<int>(duration_s / 7.0);
  for (int i = 0; i < legs; ++i) {
    const Eigen::Vector2d step =
        kBlock * Eigen::Vector2d(quarter % 2 == 0 ? 1 - quarter : 0, quarter % 2 == 1 ? 2 - quarter : 0);
    const Eigen::Vector2d here = Eigen::Vector2d(points.back().east, points.back().north) + step;
    const double speed = random.uniform() < 0.3 ? 8.3 : 13.9;
    const double stop_s = random.uniform() < 0.25 ? 4.0 + 16.0 * random.uniform() : 0.0;
    points.push_back({here.x(), here.y(), 22, speed, stop_s, false});
    const double choice = random.uniform();
    const bool outward = here.dot(step) > 0.0 && here.cwiseAbs().maxCoeff() > kHalfSize - kBlock;
    if (outward) {
      const bool left = step.x() * here.y() - step.y() * here.x() < 0.0;  // turn towards the middle
      quarter += left ? 1 : 3;
    } else if (choice < 0.5) {
      quarter += choice < 0.25 ? 1 : 3;
    }
    quarter %= 4;
  }
  return points;
}

Points corridor(double duration_s) {
  const Points lap = {
      {0, 0, 3, 1.4, 0, false}, {30, 0, 3, 1.4, 0, false}, {30, 12, 3, 1.2, 0, false}, {0, 12, 3, 1.4, 4, false}};
  Points points = {{-8, 0, 3, 1.4, 3, false}};
  const int laps = 1 + static_cast<int>(duration_s / 40.0);
  for (int i = 0; i < laps; ++i) points.insert(points.end(), lap.begin() + (i == 0 ? 1 : 0), lap.end());
  return points;
}

/// A figure of eight of two squares that have a side in common.
Points right_angles(double duration_s) {
  const Points lap = {{15, 0, 6, 2, 0, false},    {15, 15, 6, 2, 2, false}, {-15, 15, 6, 2, 0, false},
                      {-15, 0, 6, 2, 0, false},   {15, 0, 6, 2, 2, false},  {15, -15, 6, 2, 0, false},
                      {-15, -15, 6, 2, 0, false}, {-15, 0, 6, 2, 0, false}};
  Points points = {{-25, 0, 6, 2, 3, false}};
  const int laps = 1 + static_cast<int>(duration_s / 90.0);
  for (int i = 0; i < laps; ++i) points.insert(points.end(), lap.begin(), lap.end());
  points.push_back({25, 0, 6, 2, 0, false});
  return points;
}

}  // namespace

std::vector<WayPoint> way_points(RouteKind route, double duration_s) {
  switch (route) {
    case RouteKind::kStanding:
      return {{0, 0, 20, 10, duration_s + 60.0, false}, {100, 0, 20, 10, 0, false}};
    case RouteKind::kCityLoop:
      return city_loop(duration_s);
    case RouteKind::kHighway:
      return bends(duration_s, 33.3, 900.0, 450.0, 4.0);
    case RouteKind::kColdStartMoving:
      return bends(duration_s, 30.0, 700.0, 350.0, 0.0);
    case RouteKind::kTunnel:
      return bends(duration_s, 13.9, 160.0, 60.0, 3.0);
    case RouteKind::kCarPark:
      return car_park(duration_s);
    case RouteKind::kLongCity:
      return long_city(duration_s);
    case RouteKind::kCorridor:
      return corridor(duration_s);
    case RouteKind::kRightAngles:
      return right_angles(duration_s);
    case RouteKind::kTurn:
      return {{0, 0, 0, 13.9, 3, false}, {890, 0, 40, 13.9, 0, false}, {890, 1000, 0, 13.9, 0, false}};
  }
  return {};
}

double start_speed(RouteKind route) { return route == RouteKind::kColdStartMoving ? 30.0 : 0.0; }

Terrain terrain_at(const Eigen::Vector2d& p, double hill_factor) {
  struct Wave {
    double height_m, east_per_m, north_per_m, phase;
  };
  // Wave lengths of 1.5 km, 600 m and 260 m; slopes of 1.7 %, 1.6 % and 1 %.
  static constexpr Wave kWaves[] = {{4.0, 0.0035, 0.0023, 0.3}, {1.5, -0.004, 0.0097, 1.1}, {0.4, 0.022, 0.010, 2.0}};
  constexpr double kEarthRadius = 6378137.0;  // the ellipsoid falls away from the tangent plane
  Terrain t;
  t.height = -p.squaredNorm() / (2.0 * kEarthRadius);
  t.slope = -p / kEarthRadius;
  for (const Wave& w : kWaves) {
    const double phase = w.east_per_m * p.x() + w.north_per_m * p.y() + w.phase;
    t.height += hill_factor * w.height_m * (std::sin(phase) - std::sin(w.phase));
    t.slope += hill_factor * w.height_m * std::cos(phase) * Eigen::Vector2d(w.east_per_m, w.north_per_m);
  }
  return t;
}

}  // namespace roadfix
