/// Runs one start of a stage again from the inputs that the log holds, and compares what it publishes, byte for byte,
/// with what was recorded.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "bus/verify/stage_log.h"

namespace roadfix {

using NewStage = std::function<std::unique_ptr<Stage>()>;

struct RunVerdict {
  int64_t run = 0;
  int64_t identical = 0;
  int64_t differing = 0;
  int64_t unverifiable = 0;
  int64_t resumed = 0;                ///< snapshots that it went on from
  std::vector<std::string> losses;    ///< what the log lacks, as text
  std::vector<std::string> findings;  ///< what is wrong with ledger or snapshots, as text
  std::optional<std::string> first_difference;
};

/// `run` is of `log`; its outputs get their verdicts. The ledger alone decides what was taken.
RunVerdict verify_run(const NewStage& new_stage, const StageSpec& spec, const StageLog& log, int64_t run_name,
                      StageRun& run);

}  // namespace roadfix
