#include "bus/verify/verify_run.h"

#include <algorithm>
#include <limits>
#include <roadfix/horizon_t.hpp>
#include <tuple>

#include "bus/run/stage_runner.h"
#include "bus/verify/output_difference.h"

namespace roadfix {

namespace {

constexpr int64_t kEver = std::numeric_limits<int64_t>::max();
constexpr int64_t kNever = std::numeric_limits<int64_t>::min();
constexpr int64_t kMargin_us = 1'000'000'000;  // so that kNever may be subtracted from

class RunVerifier : public MessageSink {
 public:
  RunVerifier(const NewStage& new_stage, const StageSpec& spec, const StageLog& log, int64_t name, StageRun& run)
      : new_stage_(new_stage), spec_(spec), log_(log), name_(name), run_(run), losses_(find_losses(spec, log, run)) {
    for (std::size_t i = 0; i < run.outputs.size(); ++i) {
      by_name_.emplace(std::pair(run.outputs[i].output, run.outputs[i].header.seq), i);
    }
    end_ledger();
    for (const LogLoss& loss : losses_) affected_from_.push_back(affected_from(loss));
  }

  RunVerdict verify();

 private:
  /// Where to begin: the run's own beginning, or a snapshot.
  struct Start {
    const state_t* state = nullptr;
    [[nodiscard]] int64_t utime() const { return state != nullptr ? state->utime : kNever; }
  };

  void end_ledger();
  [[nodiscard]] int64_t affected_from(const LogLoss& loss) const;
  bool begin(const Start& start);
  [[nodiscard]] bool holds(const LogLoss& loss) const;
  [[nodiscard]] int64_t first_affected() const;
  int64_t run_until(const Start& start, int64_t end);
  [[nodiscard]] int64_t next_state_after(int64_t utime) const;
  void check_unpublished(int64_t after, int64_t until);
  void put(const std::string& channel, const Header& header, std::span<const uint8_t> bytes) override;
  void describe(const RecordedOutput& recorded, std::span<const uint8_t> replayed);

  const NewStage& new_stage_;
  const StageSpec& spec_;
  const StageLog& log_;
  int64_t name_;
  StageRun& run_;
  std::vector<LogLoss> losses_;
  std::vector<int64_t> affected_from_;  // per loss: outputs from this utime on may depend on it
  std::map<std::pair<int, int64_t>, std::size_t> by_name_;
  std::unique_ptr<StageRunner> runner_;
  int64_t compared_from_ = kNever;     // outputs up to this utime belong to the state that was loaded
  std::optional<int64_t> differs_at_;  // in this pass
  std::optional<std::size_t> last_identical_;
  RunVerdict verdict_;
};

/// A run that was killed, or a log that ends, leaves the last losses without their entries.
void RunVerifier::end_ledger() {
  if (run_.outputs.empty()) return;
  const RecordedOutput& last = run_.outputs.back();
  const std::string& type = spec_.outputs[static_cast<std::size_t>(last.output)].type;
  const std::optional<provenance_t> provenance = read_provenance(type, last.bytes);
  if (!provenance) return;
  std::vector<int64_t> applied_utime(provenance->last_seq.size(), kNever + kMargin_us);
  int64_t lateness_us = largest_lateness_us(spec_.inputs);
  for (const LoggedInput& logged : log_.inputs) {
    const auto i = static_cast<std::size_t>(logged.input);
    const bool applied = i < applied_utime.size() && logged.id.seq == provenance->last_seq[i];
    if (!applied || logged.id.run != run_.ledger.newest_run(logged.input)) continue;
    applied_utime[i] = logged.id.utime;
    if (logged.input == horizon_input(spec_)) lateness_us = decode<horizon_t>(logged.bytes).lateness_us;
  }
  run_.ledger.end_with(last.header.utime, *provenance, std::move(applied_utime), lateness_us);
  std::map<int, std::pair<int64_t, int64_t>> unsettled;
  for (const LoggedInput& logged : log_.inputs) {
    if (!run_.ledger.unsettled_at_end(logged.input, logged.id) || run_.ledger.excludes(logged.input, logged.id))
      continue;
    const auto [range, first] = unsettled.try_emplace(logged.input, logged.id.seq, logged.id.seq);
    range->second.second = std::max(range->second.second, logged.id.seq);
  }
  for (const auto& [input, range] : unsettled) {
    verdict_.findings.push_back(spec_.inputs[static_cast<std::size_t>(input)].channel + " seq " +
                                std::to_string(range.first) + " to " + std::to_string(range.second) +
                                ": not applied when the run ended, before its ledger could tell why");
  }
}

/// A clock sample acts when it comes. Another input acts when the horizon passes it: the first output that had applied
/// it, or what lies behind it, bounds the time.
int64_t RunVerifier::affected_from(const LogLoss& loss) const {
  const bool is_clock = std::any_of(spec_.clocks.begin(), spec_.clocks.end(),
                                    [&](const ClockSpec& clock) { return clock.input == loss.input; });
  if (loss.after_utime == kNever) return kNever;
  if (is_clock) return loss.after_utime + 1;
  for (const RecordedOutput& output : run_.outputs) {
    if (output.header.utime <= loss.after_utime) continue;
    const std::string& type = spec_.outputs[static_cast<std::size_t>(output.output)].type;
    const std::optional<provenance_t> provenance = read_provenance(type, output.bytes);
    const auto input = static_cast<std::size_t>(loss.input);
    if (!provenance || input >= provenance->last_seq.size()) return loss.after_utime + 1;
    if (provenance->last_seq[input] >= loss.first_seq) return output.header.utime;
  }
  return kEver;
}

/// False where the run cannot begin there; the reason is a finding.
bool RunVerifier::begin(const Start& start) {
  runner_ = std::make_unique<StageRunner>(new_stage_(), *this);
  runner_->replay_decisions(&run_.ledger);
  std::vector<std::pair<int, int64_t>> input_runs;
  runner_->name_run(name_);
  compared_from_ = start.utime();
  if (start.state == nullptr) {
    run_.ledger.begin_from(0, {});
    return true;
  }
  try {
    runner_->resume(*start.state);
  } catch (const std::runtime_error& e) {
    verdict_.findings.push_back("the snapshot at " + std::to_string(start.utime()) + " cannot be loaded: " + e.what());
    return false;
  }
  for (int i = 0; i < static_cast<int>(spec_.inputs.size()); ++i) {
    const InputTrack& track = runner_->stream().track(i);
    if (track.applied) input_runs.emplace_back(i, track.applied->run);
    if (track.settled) input_runs.emplace_back(i, track.settled->run);
  }
  run_.ledger.begin_from(start.state->provenance.ledger_entries, input_runs);
  return true;
}

/// Whether the state that was begun from holds what the log lacks.
bool RunVerifier::holds(const LogLoss& loss) const {
  const std::optional<InputTrack::Applied>& applied = runner_->stream().track(loss.input).applied;
  const std::optional<int64_t> horizon = runner_->stream().horizon_utime();
  const int64_t delay_us = spec_.inputs[static_cast<std::size_t>(loss.input)].effect_delay_us;
  if (horizon && loss.before_utime != kEver && loss.before_utime + delay_us <= *horizon) return true;
  return applied && (applied->run > loss.run || (applied->run == loss.run && applied->seq >= loss.last_seq));
}

int64_t RunVerifier::first_affected() const {
  int64_t end = kEver;
  for (std::size_t i = 0; i < losses_.size(); ++i) {
    if (!holds(losses_[i])) end = std::min(end, affected_from_[i]);
  }
  return end;
}

/// Offers the inputs behind the start until `end`, or until the snapshot after a difference. Returns up to where the
/// outputs were compared.
int64_t RunVerifier::run_until(const Start& start, int64_t end) {
  int64_t from = kNever;
  if (start.state != nullptr) {
    int64_t delay_us = 0;
    for (const InputSpec& input : spec_.inputs) delay_us = std::max(delay_us, input.effect_delay_us);
    from = start.state->horizon_utime - delay_us;
  }
  auto input = std::partition_point(log_.inputs.begin(), log_.inputs.end(),
                                    [&](const LoggedInput& logged) { return logged.id.utime <= from; });
  differs_at_.reset();
  int64_t reached = kNever;
  for (; input != log_.inputs.end() && input->id.utime < end; ++input) {
    runner_->offer(input->input, input->bytes);
    reached = input->id.utime;
    if (differs_at_) end = std::min(end, next_state_after(*differs_at_));
  }
  return input == log_.inputs.end() ? reached : end - 1;
}

int64_t RunVerifier::next_state_after(int64_t utime) const {
  for (const state_t& state : run_.states) {
    if (state.utime > utime) return state.utime + 1;
  }
  return kEver;
}

/// What was recorded in a stretch that was run again, and did not come again.
void RunVerifier::check_unpublished(int64_t after, int64_t until) {
  for (RecordedOutput& output : run_.outputs) {
    if (output.header.utime <= after || output.header.utime > until) continue;
    if (output.verdict == OutputVerdict::kUnverifiable) {
      output.verdict = OutputVerdict::kDiffering;
      describe(output, {});
    }
  }
}

RunVerdict RunVerifier::verify() {
  std::vector<Start> starts;
  if (run_.has_beginning) starts.push_back({});
  for (const state_t& state : run_.states) starts.push_back({&state});
  int64_t done = kNever;
  bool ledger_checked = false;
  for (const Start& start : starts) {
    if (start.state != nullptr && start.utime() < done) continue;
    if (!begin(start)) continue;
    const int64_t end = first_affected();
    if (end <= start.utime() || end == kNever) continue;
    if (!ledger_checked) {
      const int64_t known = start.state != nullptr ? start.state->provenance.ledger_entries : 0;
      for (const auto& [first, last] : run_.ledger.missing_after(known)) {
        verdict_.findings.push_back("ledger entries " + std::to_string(first) + " to " + std::to_string(last) +
                                    " are not in the log");
      }
      ledger_checked = true;
    }
    if (start.state != nullptr) ++verdict_.resumed;
    done = run_until(start, end);
    check_unpublished(start.utime(), done);
  }
  for (const RecordedOutput& output : run_.outputs) {
    verdict_.identical += output.verdict == OutputVerdict::kIdentical ? 1 : 0;
    verdict_.differing += output.verdict == OutputVerdict::kDiffering ? 1 : 0;
    verdict_.unverifiable += output.verdict == OutputVerdict::kUnverifiable ? 1 : 0;
  }
  for (const LogLoss& loss : losses_) verdict_.losses.push_back(describe_loss(spec_, loss));
  return verdict_;
}

void RunVerifier::put(const std::string& channel, const Header& header, std::span<const uint8_t> bytes) {
  int output = 0;
  const auto outputs = static_cast<int>(spec_.outputs.size());
  while (output < outputs && spec_.outputs[static_cast<std::size_t>(output)].channel != channel) ++output;
  if (output == outputs || header.utime <= compared_from_) return;
  const auto found = by_name_.find({output, header.seq});
  if (found == by_name_.end()) return;  // the logger lost it, or the stage had ended
  RecordedOutput& recorded = run_.outputs[found->second];
  if (std::equal(bytes.begin(), bytes.end(), recorded.bytes.begin(), recorded.bytes.end())) {
    recorded.verdict = OutputVerdict::kIdentical;
    last_identical_ = found->second;
    return;
  }
  recorded.verdict = OutputVerdict::kDiffering;
  if (!differs_at_) differs_at_ = header.utime;
  describe(recorded, bytes);
}

void RunVerifier::describe(const RecordedOutput& recorded, std::span<const uint8_t> replayed) {
  if (!differs_at_) differs_at_ = recorded.header.utime;
  if (verdict_.first_difference) return;
  const RecordedOutput* before = last_identical_ ? &run_.outputs[*last_identical_] : nullptr;
  verdict_.first_difference = describe_difference(spec_, recorded, replayed, before);
}

}  // namespace

RunVerdict verify_run(const NewStage& new_stage, const StageSpec& spec, const StageLog& log, int64_t run_name,
                      StageRun& run) {
  RunVerdict verdict = RunVerifier(new_stage, spec, log, run_name, run).verify();
  verdict.run = run_name;
  return verdict;
}

}  // namespace roadfix
