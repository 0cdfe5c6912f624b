/// Trajectories for maps. Both formats mean heights above sea level: where those are not known they are left out.
#pragma once

#include <functional>
#include <optional>
#include <ostream>
#include <string>

#include "evaluation/trajectory.h"

namespace roadfix {

/// What of a place's height the caller knows.
struct SeaLevel {
  std::optional<double> height_m;      ///< of the place above the geoid
  std::optional<double> separation_m;  ///< of the geoid above the ellipsoid
};
using SeaLevelOf = std::function<SeaLevel(const Geodetic&)>;

/// GPX 1.1 (topografix.com/GPX/1/1): one track, a new segment after each stretch of invalid poses, `fix` none where the
/// pose coasts.
void write_gpx(std::ostream& out, const Trajectory& trajectory, const Geodetic& anchor, const std::string& name,
               const SeaLevelOf& sea_level);

/// KML 2.2 (OGC 07-147r2): a line with its time for each stretch of one validity, green where the pose is valid and
/// orange where it coasts; on the ground where heights are not known.
void write_kml(std::ostream& out, const Trajectory& trajectory, const Geodetic& anchor, const std::string& name,
               const SeaLevelOf& sea_level);

}  // namespace roadfix
