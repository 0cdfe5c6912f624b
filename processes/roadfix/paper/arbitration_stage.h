/// POSE_PRINTED and VO_RESTART from POSE_WHEEL and POSE_VO by the scheme of Ock et al. (2020): translates between messages and
/// papers/printed_localization.h. For `roadfix paper b` alone: it has no snapshots.
#pragma once

#include <memory>
#include <vector>

#include "bus/stage.h"
#include "papers/printed_localization.h"

namespace roadfix {

/// What was decided at one picture.
struct ArbitrationRecord {
  int64_t t_us = 0;
  PrintedLocalization::Report report;
};

/// `records` is filled while the stage runs, and outlives it.
std::unique_ptr<Stage> make_arbitration_stage(const PrintedLocalizationConfig& config,
                                              std::vector<ArbitrationRecord>& records);

}  // namespace roadfix
