/// When was there an estimate, and was it published as valid?
#pragma once

#include <cstdint>
#include <vector>

#include "evaluation/trajectory.h"

namespace roadfix {

/// What a consumer has at a time: silence is no estimate at all.
enum class Presence { kSilent, kInvalid, kCoasting, kValid };

struct PresenceSpan {
  int64_t begin_us = 0;
  int64_t end_us = 0;
  Presence presence = Presence::kSilent;
};

struct Availability {
  double valid = 0.0;  ///< shares of the time asked about
  double coasting = 0.0;
  double invalid = 0.0;
  double silent = 0.0;
  std::vector<PresenceSpan> spans;  ///< without a gap, in order
};

/// Over [begin_us, end_us]. A pose holds until the next one, and no longer than the stream's largest regular gap.
Availability availability(const Trajectory& estimate, int64_t begin_us, int64_t end_us);

}  // namespace roadfix
