// What a stage publishes beside its outputs: ledger, snapshots, configuration.
#include <cctype>

#include "bus/run/process_facts.h"
#include "bus/run/stage_runner.h"
#include "stream/config_hash.h"

namespace roadfix {

namespace {

/// Of the bytes in state_t::state that are the runner's; the stage's own layout is in the message.
constexpr int64_t kRunnerLayout = 3;

/// Data time after which the entries of the last minute are published again.
constexpr int64_t kRepeatLedger_us = 5'000'000;

}  // namespace

std::string stage_channel(const std::string& prefix, const std::string& stage_name) {
  std::string channel = prefix;
  for (const char c : stage_name) channel += static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return channel;
}

/// Before the outputs that the new entries affect; and again now and then, so that a logger may lose one.
void StageRunner::publish_ledger() {
  const bool again = !stream_.ledger().recent().empty() && now_utime_ >= ledger_utime_ + kRepeatLedger_us;
  if (stream_.ledger().total() == ledger_published_ && !again) return;
  ledger_published_ = stream_.ledger().total();
  ledger_utime_ = now_utime_;
  ledger_t ledger{};
  ledger.utime = now_utime_;
  ledger.run = *stream_.run();
  ledger.seq = next_ledger_seq_++;
  ledger.num_entries_total = ledger_published_;
  for (const LedgerEntry& from : stream_.ledger().recent()) {
    ledger_entry_t& to = ledger.entries.emplace_back();
    to.entry = from.entry;
    to.at_clock_utime = from.at_clock_utime;
    to.kind = static_cast<int8_t>(from.kind);
    to.channel = spec().inputs[static_cast<std::size_t>(from.input)].channel;
    to.input_run = from.run;
    to.first_seq = from.first_seq;
    to.last_seq = from.last_seq;
    to.input_utime = from.utime;
  }
  ledger.num_entries = static_cast<int32_t>(ledger.entries.size());
  sink_.put(ledger_channel_, {ledger.utime, ledger.run, ledger.seq}, encode(ledger));
}

/// After the outputs of its tick, so that the state holds what publishing them has changed.
void StageRunner::publish_state_if_due() {
  bool due = stage_->wants_snapshot();
  if (spec().snapshots == Snapshots::kPeriodic) {
    const int64_t slot = now_utime_ / kSnapshot_us;
    if (state_slot_ && state_slot_ != slot) due = true;  // a start has nothing worth keeping
    state_slot_ = slot;
  }
  if (due) publish_state();
}

void StageRunner::publish_state() {
  StateWriter writer;
  writer.put(kRunnerLayout);
  stream_.save(writer);
  writer.put(static_cast<int64_t>(next_seq_.size()));
  for (const int64_t seq : next_seq_) writer.put(seq);
  for (const int64_t value : {next_state_seq_, state_slot_.value_or(0)}) writer.put(value);
  writer.put(std::span<const uint8_t>(stage_->save()));
  state_t state{};
  state.utime = now_utime_;
  state.run = *stream_.run();
  state.seq = next_state_seq_++;
  state.provenance = provenance();
  state.horizon_utime = *stream_.horizon_utime();
  state.process = spec().name;
  state.layout = spec().state_layout;
  state.state = writer.take();
  state.size_bytes = static_cast<int32_t>(state.state.size());
  sink_.put(state_channel_, {state.utime, state.run, state.seq}, encode(state));
}

void StageRunner::resume(const state_t& state) {
  if (state.process != spec().name || state.layout != spec().state_layout) {
    throw std::runtime_error("state: of " + state.process + ", layout " + std::to_string(state.layout) + ", not " +
                             spec().name + ", layout " + std::to_string(spec().state_layout));
  }
  StateReader reader(state.state);
  if (reader.get<int64_t>() != kRunnerLayout) throw std::runtime_error("state: written by another version");
  stream_.load(reader);
  if (reader.get<int64_t>() != static_cast<int64_t>(next_seq_.size())) {
    throw std::runtime_error("state: of a stage with other outputs");
  }
  for (int64_t& seq : next_seq_) reader.get(seq);
  next_state_seq_ = reader.get<int64_t>();
  ++next_state_seq_;
  state_slot_ = reader.get<int64_t>();
  std::vector<uint8_t> stage_state;
  reader.get(stage_state);
  reader.finish();
  stage_->load(stage_state);
  ledger_published_ = stream_.ledger().total();
}

config_t StageRunner::config_message() const {
  config_t config{};
  config.process = spec().name;
  config.config_yaml = stage_->effective_config();
  config.calibration_yaml = stage_->effective_calibration();
  config.config_hash = config_hash(config.config_yaml, config.calibration_yaml);
  config.build_id = build_id();
  config.library_versions = library_versions();
  config.cpu_features = cpu_features();
  return config;
}

std::vector<double> StageRunner::take_apply_p99_s() {
  std::vector<double> p99_s(spec().inputs.size());
  if (timing_ == nullptr) return p99_s;
  for (std::size_t i = 0; i < timing_->handlers(); ++i) {
    const double p99_us = timing_->take_p99_us(i);
    if (i < p99_s.size()) p99_s[i] = p99_us * 1e-6;
  }
  return p99_s;
}

}  // namespace roadfix
