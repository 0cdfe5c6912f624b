#include "bus/run/stage_runner.h"

#include <cctype>
#include <cstring>
#include <roadfix/horizon_t.hpp>
#include <stdexcept>

namespace roadfix {

namespace {

/// Behind the handlers of the inputs come these two.
std::vector<std::string> handler_names(const StageSpec& spec) {
  std::vector<std::string> names;
  for (const InputSpec& input : spec.inputs) names.push_back(spec.name + " apply " + input.channel);
  names.push_back(spec.name + " on_clock");
  names.push_back(spec.name + " publish");
  return names;
}

}  // namespace

int horizon_input(const StageSpec& spec) {
  const std::string channel = stage_channel("HORIZON_", spec.name);
  for (std::size_t i = 0; i < spec.inputs.size(); ++i) {
    if (spec.inputs[i].channel == channel && spec.inputs[i].type == "horizon_t") return static_cast<int>(i);
  }
  return -1;
}

int delivery_order(const StageSpec& spec, int input) {
  for (std::size_t i = 0; i < spec.clocks.size(); ++i) {
    if (spec.clocks[i].input == input) return static_cast<int>(spec.clocks.size() - i);
  }
  return 0;
}

StageRunner::StageRunner(std::unique_ptr<Stage> stage, MessageSink& sink)
    : stage_(std::move(stage)),
      horizon_input_(horizon_input(stage_->spec())),
      sink_(sink),
      stream_(stage_->spec().inputs, stage_->spec().clocks),
      next_seq_(stage_->spec().outputs.size()),
      ledger_channel_(stage_channel("LEDGER_", stage_->spec().name)),
      state_channel_(stage_channel("STATE_", stage_->spec().name)) {
  for (const InputSpec& input : spec().inputs) checks_.push_back(Schema::built_in().check_of(input.type));
  for (const OutputSpec& output : spec().outputs) static_cast<void>(Schema::built_in().type(output.type));
  for (const ClockSpec& clock : spec().clocks) {
    if (clock.input < 0 || clock.input >= static_cast<int>(spec().inputs.size())) {
      throw std::logic_error(spec().name + ": a clock names input " + std::to_string(clock.input));
    }
  }
  if (spec().clocks.empty()) throw std::logic_error(spec().name + ": names no clock");
}

HandlerTiming& StageRunner::measure_time() {
  timing_ = std::make_unique<HandlerTiming>(handler_names(spec()));
  return *timing_;
}

/// The message's name; nothing, and an entry in the ledger, where it cannot be decoded.
std::optional<EventId> StageRunner::check(int input, std::span<const uint8_t> bytes) {
  const CheckResult result = checks_[static_cast<std::size_t>(input)](bytes);
  const std::optional<Header> header = read_header(bytes);
  const bool plausible = header && is_plausible(*header);
  if (result == CheckResult::kOk && plausible) return EventId{header->utime, header->run, header->seq};
  // With the wrong fingerprint the bytes behind it name nothing.
  std::optional<EventId> id;
  if (plausible && result != CheckResult::kWrongType) id = EventId{header->utime, header->run, header->seq};
  stream_.note_undecodable(input, id);
  return std::nullopt;
}

bool StageRunner::can_decode(int input, std::span<const uint8_t> bytes) const {
  return checks_[static_cast<std::size_t>(input)](bytes) == CheckResult::kOk;
}

Offer StageRunner::offer(int input, std::span<const uint8_t> bytes) {
  const std::optional<EventId> id = check(input, bytes);
  if (!id) return Offer::kRefused;
  const Offer offer = stream_.offer(input, *id, bytes);
  if (offer == Offer::kTick) tick({input, id->utime, id->run, id->seq, bytes});
  return offer;
}

Offer StageRunner::skip(int input, std::span<const uint8_t> bytes) {
  const std::optional<EventId> id = check(input, bytes);
  return id ? stream_.skip(input, *id) : Offer::kRefused;
}

void StageRunner::tick(const Message& sample) {
  const auto handlers = spec().inputs.size();
  {
    const HandlerTiming::Scope scope(timing_.get(), handlers);
    stage_->on_clock(sample);
  }
  if (stream_.resumes_at()) return;  // published by the run that the state is from
  while (const WaitingInput* waiting = stream_.next()) {
    apply(*waiting);
  }
  stream_.close_tick();
  now_utime_ = sample.utime;
  provenance_current_ = false;
  publish_ledger();
  {
    const HandlerTiming::Scope scope(timing_.get(), handlers + 1);
    stage_->publish(now_utime_, *this);
  }
  publish_state_if_due();
}

void StageRunner::apply(const WaitingInput& waiting) {
  const HandlerTiming::Scope scope(timing_.get(), static_cast<std::size_t>(waiting.input));
  if (waiting.input == horizon_input_) {
    stream_.allow_lateness(decode<horizon_t>(waiting.bytes).lateness_us);
    return;
  }
  stage_->apply({waiting.input, waiting.id.utime, waiting.id.run, waiting.id.seq, waiting.bytes});
}

Header StageRunner::stamp(int output) {
  return {now_utime_, *stream_.run(), next_seq_.at(static_cast<std::size_t>(output))++};
}

/// The same for all outputs of one tick.
const provenance_t& StageRunner::provenance() {
  if (provenance_current_) return provenance_;
  digest_.clear();
  digest_.add(static_cast<int64_t>(stream_.input_digest()));
  stage_->digest(digest_);
  provenance_.digest = static_cast<int64_t>(digest_.value());
  provenance_.ledger_entries = stream_.ledger_total();
  const std::size_t inputs = spec().inputs.size();
  provenance_.num_inputs = static_cast<int32_t>(inputs);
  provenance_.last_seq.resize(inputs);
  provenance_.num_applied.resize(inputs);
  for (std::size_t i = 0; i < inputs; ++i) {
    const std::optional<InputTrack::Applied>& applied = stream_.track(static_cast<int>(i)).applied;
    provenance_.last_seq[i] = applied ? applied->seq : -1;
    provenance_.num_applied[i] = applied ? applied->count : 0;
  }
  provenance_current_ = true;
  return provenance_;
}

void StageRunner::send(int output, const char* type, std::span<const uint8_t> bytes) {
  const OutputSpec& declared = spec().outputs.at(static_cast<std::size_t>(output));
  if (declared.type != type) throw std::logic_error(spec().name + ": " + declared.channel + " is no " + type);
  sink_.put(declared.channel, *read_header(bytes), bytes);
}

}  // namespace roadfix
