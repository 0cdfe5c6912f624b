/// What a recorded drive holds of one stage: its inputs, and what each of its runs published. For verify.
#pragma once

#include <map>
#include <memory>
#include <roadfix/state_t.hpp>
#include <set>
#include <string>
#include <vector>

#include "bus/log/log_index.h"
#include "bus/verify/ledger_record.h"

namespace roadfix {

/// One logged input that passed its check.
struct LoggedInput {
  int input = 0;
  EventId id;
  std::span<const uint8_t> bytes;
};

enum class OutputVerdict { kUnverifiable, kIdentical, kDiffering };

struct RecordedOutput {
  int output = 0;
  Header header;
  std::span<const uint8_t> bytes;
  OutputVerdict verdict = OutputVerdict::kUnverifiable;
};

/// One start of the stage.
struct StageRun {
  explicit StageRun(const StageSpec& spec) : ledger(spec) {}

  std::vector<RecordedOutput> outputs;  ///< by utime, output, seq
  LedgerRecord ledger;
  bool has_beginning = false;   ///< the ledger's first entry is recorded
  std::vector<state_t> states;  ///< by utime
};

struct StageLog {
  std::vector<LoggedInput> inputs;   ///< by utime, and at one utime as a stage is given them
  std::map<int64_t, StageRun> runs;  ///< by run
  std::vector<std::string> damage;   ///< messages that failed their check, as text
};

/// `readers` must outlive the result.
StageLog collect_stage_log(const StageSpec& spec, const std::vector<LogReader*>& readers, const LogIndex& index);

/// What a message was computed from, by its provenance; nothing where its type has none. It must have passed its
/// check.
std::optional<provenance_t> read_provenance(const std::string& type, std::span<const uint8_t> bytes);

/// Inputs that the log does not have although the stage may have used them.
struct LogLoss {
  int input = 0;
  int64_t run = 0;
  int64_t first_seq = 0;
  int64_t last_seq = 0;
  int64_t after_utime = 0;   ///< their utimes lie behind this
  int64_t before_utime = 0;  ///< and before this
};

std::vector<LogLoss> find_losses(const StageSpec& spec, const StageLog& log, const StageRun& run);

}  // namespace roadfix
