/// Fixes of a comma2k19 segment's live_gnss_ublox or live_gnss_qcom: latitude and longitude in deg, speed, UTC, altitude,
/// bearing in deg.
#pragma once

#include <vector>

#include "roadfix/import/comma2k19_log.h"
#include "samples/samples.h"

namespace roadfix {

struct CommaFixes {
  std::vector<GnssFix> list;
  bool at_own_times = false;      ///< of the receiver; else of the messages' arrival
  std::size_t without_place = 0;  ///< rows, left out
};

CommaFixes comma_fixes(const CommaLog& log);

}  // namespace roadfix
