/// The scenarios by name, and the roads that they drive on.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "simulation/route.h"
#include "simulation/scenario_config.h"

namespace roadfix {

/// Names of the scenarios, in the order of a listing.
std::vector<std::string> scenario_names();

/// One line on what a scenario is.
std::string scenario_summary(std::string_view name);

/// The configuration of a named scenario; std::invalid_argument, naming all, where there is none.
ScenarioConfig scenario(std::string_view name);

/// An imu without any error.
ImuConfig perfect_imu(double rate_hz);

/// Way points of a route, enough of them for duration_s.
std::vector<WayPoint> way_points(RouteKind route, double duration_s);

/// Speed at which a route begins, m/s (zero: standing).
double start_speed(RouteKind route);

/// Height of the ground and its slope by east and north. Rolling hills on the ellipsoid; hill_factor 0 is level.
struct Terrain {
  double height = 0.0;
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();
};
Terrain terrain_at(const Eigen::Vector2d& p, double hill_factor);

}  // namespace roadfix
