/// A pose message as the contents of NMEA sentences.
#pragma once

#include <optional>
#include <roadfix/pose_t.hpp>

#include "drivers/protocols/nmea_writer.h"
#include "pose_server/geoid.h"
#include "samples/samples.h"

namespace roadfix {

/// What a pose rests on: the newest fix that was used.
struct FixFacts {
  NmeaQuality quality = NmeaQuality::kDeadReckoning;
  /// Of the fixes: the estimators take heights as the receiver gives them.
  HeightKind height_kind = HeightKind::kUnknown;
  std::optional<int> num_satellites;
  std::optional<double> correction_age_s;
};

/// `point`: its position is sent, in vehicle axes from the pose's origin. Invalid poses, poses of a local frame or of
/// unknown scale have neither position nor heading; a coasting one is dead reckoning whatever the fix.
/// Heights above sea level: as they are where the receiver's are; by the geoid where there is one and the receiver's
/// are above the ellipsoid; otherwise absent.
NmeaPose nmea_pose(const pose_t& message, const FixFacts& fix, const Eigen::Vector3d& point, const GeoidModel* geoid);

/// NMEA's word for a type of fix.
NmeaQuality quality_of(FixType type);

}  // namespace roadfix
