/// The evaluation of a log's estimates, as `roadfix evaluate` and every task of a fleet do it.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "roadfix/evaluate/report.h"

namespace roadfix {

struct EvaluationRequest {
  std::filesystem::path log;
  std::filesystem::path reference;    ///< the log with REFERENCE and CONFIG_DRIVE, where it is another one
  std::vector<std::string> channels;  ///< to score; every POSE_* channel where empty
  EvaluationOptions options;
  std::map<std::string, std::optional<Alignment>> alignments;  ///< by channel, in place of options.alignment
};

/// What --align takes.
const std::vector<std::string>& alignment_choices();

/// Nothing for auto: by the estimate's frame. EvaluationLogError for a name that is none.
std::optional<Alignment> alignment_named(const std::string& name);

/// EvaluationLogError where a channel that was asked for, all estimates or the reference are missing.
EvaluationReport evaluate_log(const EvaluationRequest& request);

}  // namespace roadfix
