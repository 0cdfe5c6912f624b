/// Trajectories as the texts that other tools read. Numbers keep their digits: positions to 1e-9 m, degrees to 1e-12.
#pragma once

#include <optional>
#include <ostream>

#include "evaluation/trajectory.h"

namespace roadfix {

/// "t x y z qx qy qz qw" a line, t in s since 1970 with microseconds (the format of the TUM RGB-D benchmark; evo reads
/// it). Poses marked invalid are left out, here and in every other format but CSV.
void write_tum(std::ostream& out, const Trajectory& trajectory);

/// Twelve numbers a line, the rows of [R t], relative to the first pose as KITTI has it; times are lost.
void write_kitti(std::ostream& out, const Trajectory& trajectory);

/// One line a pose with a header that names columns and units: all that a pose_t has, sigmas for covariances. With an
/// anchor: latitude, longitude and height besides.
void write_csv(std::ostream& out, const Trajectory& trajectory, const std::optional<Geodetic>& anchor);

/// A GeoJSON feature (RFC 7946) with the path as a LineString and one property, `times`, of ISO 8601 texts.
void write_geojson(std::ostream& out, const Trajectory& trajectory, const Geodetic& anchor, const std::string& name);

/// 2026-11-21T03:14:40.250000Z
std::string iso_time(int64_t t_us);

}  // namespace roadfix
