/// What one run of a stage wrote into its ledger, read back from a log: in verify it alone decides what was taken.
#pragma once

#include <map>
#include <roadfix/ledger_t.hpp>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "bus/stage.h"
#include "stream/input_stream.h"

namespace roadfix {

class LedgerRecord : public RecordedDecisions {
 public:
  explicit LedgerRecord(const StageSpec& spec) : spec_(spec) {}

  /// One message of the run; entries that were there before are the same.
  void add(const ledger_t& ledger);

  /// Entries up to this number, and these runs of the inputs, are in the state that verify goes on from.
  void begin_from(int64_t entries, const std::vector<std::pair<int, int64_t>>& input_runs);

  /// The run ended with this output: what its ledger had no time for. Inputs of the last 10 s that the horizon had
  /// passed, but that lie behind the last ones applied, were not there in time; nor were older ones of a channel of
  /// which none was ever applied; nor what has later numbers and much older stamps than the last ones applied: the
  /// stamps went back, and another run of the stage took it. `applied_utime`: per input, of the last one applied, as
  /// far as the log has it; `lateness_us`: what the horizon allowed then.
  void end_with(int64_t last_utime, const provenance_t& provenance, std::vector<int64_t> applied_utime,
                int64_t lateness_us);

  [[nodiscard]] bool accepts(int input, const EventId& id) const override;
  [[nodiscard]] bool changes_clock(int input, const EventId& id) const override;
  [[nodiscard]] bool clock_suspended(int64_t utime) const override;
  [[nodiscard]] int64_t entries_at(int64_t clock_utime) const override;

  /// Whether the stage never used this message, by the ledger.
  [[nodiscard]] bool excludes(int input, const EventId& id) const;
  /// First seq that the stage took of this run, where its beginning is recorded.
  [[nodiscard]] std::optional<int64_t> began_at(int input, int64_t run) const;
  /// Of those whose beginning is recorded.
  [[nodiscard]] std::optional<int64_t> newest_run(int input) const;
  /// Numbers above `known` that the log does not have, as first and last.
  [[nodiscard]] std::vector<std::pair<int64_t, int64_t>> missing_after(int64_t known) const;
  /// Whether the message falls under end_with().
  [[nodiscard]] bool unsettled_at_end(int input, const EventId& id) const;

 private:
  struct Range {
    int64_t first_seq = 0;
    int64_t last_seq = 0;
    int64_t utime = 0;  // of first_seq: an older message of the same name is another one
  };
  using InputRun = std::pair<int, int64_t>;

  void take(const ledger_entry_t& entry);

  const StageSpec& spec_;
  int64_t total_ = 0;  // of the messages
  std::set<int64_t> numbers_;
  std::map<int64_t, int64_t> newest_at_;  // the highest number entered at each clock sample
  std::map<InputRun, std::vector<Range>> excluded_;
  std::map<InputRun, int64_t> began_;
  std::set<InputRun> known_runs_;
  std::set<std::tuple<int, int64_t, int64_t>> clock_changes_;
  std::map<int64_t, int64_t> clock_gaps_;  // from the last tick before a change of clock to the change
  int64_t base_ = 0;
  int64_t last_utime_ = 0;  // 0: the end is not known
  std::vector<int64_t> last_seq_;
  std::vector<int64_t> applied_utime_;
  int64_t lateness_us_ = 0;
};

}  // namespace roadfix
