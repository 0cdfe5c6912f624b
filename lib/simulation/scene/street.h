/// A street built around the path that the vehicle drives: road with markings, house fronts, parked and moving cars,
/// poles, tunnels, a bridge, a corridor.
///
/// Everything random on it comes from hashes of the seed and of the place, so that no two places look alike by
/// accident, and a place that is passed twice (the second lap of a loop) is one place and looks the same.
#pragma once

#include <cstdint>
#include <vector>

#include "simulation/camera_config.h"
#include "simulation/scene/world.h"

namespace roadfix {

/// From begin_m of distance driven up to the next one's begin.
struct StreetSegment {
  double begin_m = 0.0;
  StreetKind kind = StreetKind::kStreet;
};

struct StreetPlan {
  std::vector<Eigen::Vector3d> driven;  ///< the vehicle's origin on the ground, in order, enu, at most about 2 m apart
  std::vector<StreetSegment> segments;  ///< ascending, the first at 0
  std::uint64_t seed = 1;
  bool moving_cars = true;
  double sun_azimuth = 4.0;    ///< rad, counterclockwise from east
  double sun_elevation = 0.8;  ///< rad
};

/// Throws std::invalid_argument where the plan has fewer than two distinct points or its segments do not ascend from 0.
World build_world(const StreetPlan& plan);

}  // namespace roadfix
