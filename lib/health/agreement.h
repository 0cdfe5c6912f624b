/// Do two estimates contradict each other? Absolute ones in place, all of them in how far they moved: a frame of its
/// own hides where an estimate is, but not how it moves. MODEL.md (H.3.1), (H.3.2).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "health/pose_monitor.h"

namespace roadfix {

struct Agreement {
  std::string a, b;
  std::optional<double> apart;   ///< m between two absolute poses of one moment
  std::optional<double> sigmas;  ///< that distance in standard deviations of both together
  std::optional<double> motion;  ///< m between their two motions over the window
  double distance = 0.0;         ///< m, the longer of the two motions
  bool contradicts_place = false;
  bool contradicts_motion = false;
};

/// Of two estimates whose newest outputs are recent; absent where there is nothing to compare.
std::optional<Agreement> compare(const PoseMonitor& a, const PoseMonitor& b, int64_t now_us,
                                 const ConsistencyLimits& limits);

void check(const Agreement& agreement, double window_s, std::vector<Condition>& out);

}  // namespace roadfix
