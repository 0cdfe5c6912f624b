/// From samples to queued measurements: screening apart, what a measurement is in the level frame, with its floors.
#pragma once

#include <optional>

#include "geodesy/enu_anchor.h"
#include "navigation/measurement_queue.h"

namespace roadfix::navigation {

/// Position, velocity and heading of a fix, as far as it has them and the configuration uses them.
struct QueuedFix {
  std::optional<Queued> position, velocity, heading;
};
QueuedFix queued(const GnssFix& fix, int64_t id, const EnuAnchor& enu, const NavigationConfig& config);
/// Nothing where a speed is no car's.
std::optional<Queued> queued(const WheelSample& wheels, int64_t id, const NavigationConfig& config);
std::optional<Queued> queued(const MagSample& mag, int64_t id, const NavigationConfig& config);

}  // namespace roadfix::navigation
