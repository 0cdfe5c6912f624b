#include "bus/run/replay.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "bus/log/log_index.h"
#include "bus/log/log_survey.h"
#include "bus/log/log_writer.h"
#include "bus/log/output_place.h"
#include "bus/log/stray_stamps.h"

namespace roadfix {

namespace {

constexpr int64_t kNever = std::numeric_limits<int64_t>::min();

class Replayer : public MessageSink {
 public:
  Replayer(const std::filesystem::path& in, const std::filesystem::path& out,
           std::vector<std::unique_ptr<Stage>> stages, const ReplayOptions& options);
  ReplaySummary run();

 private:
  /// A message for one input of one stage.
  struct Delivery {
    int order = 0;
    int input = 0;
    std::span<const uint8_t> bytes;
    std::vector<uint8_t> own;  // what `bytes` points to, unless that is the log
  };
  struct Route {
    std::size_t stage = 0;
    int input = 0;
    int order = 0;
  };
  /// Where a stage begins: at once, or at a snapshot.
  struct Beginning {
    int64_t inputs_after = kNever;   // inputs up to this utime are in the state
    int64_t outputs_after = kNever;  // and these had been published
  };
  struct Write {
    std::string channel;
    int64_t seq = 0;
    std::vector<uint8_t> bytes;
  };

  void route(std::size_t stage);
  void require_clock(const StageRunner& runner) const;
  [[nodiscard]] bool is_copied(const std::string& channel) const;
  void pass_over_stray_stamps();
  void begin_at_snapshot(std::size_t stage);
  void dispatch(std::size_t begin, std::size_t end);
  void put(const std::string& channel, const Header& header, std::span<const uint8_t> bytes) override;
  void write_group();
  ReplaySummary summary() const;

  const ReplayOptions& options_;
  LogReader reader_;
  LogWriter writer_;
  std::vector<std::unique_ptr<StageRunner>> runners_;
  std::vector<Beginning> beginnings_;
  std::map<std::string, std::vector<Route>> routes_;
  std::map<std::string, std::size_t> producers_;
  LogIndex index_;
  std::vector<bool> passed_over_;  // of the index's messages
  Header first_, last_;            // of those that are not
  std::vector<std::vector<Delivery>> inboxes_;
  std::vector<Write> writes_;
  int64_t utime_ = 0;
  ReplaySummary summary_;
};

Replayer::Replayer(const std::filesystem::path& in, const std::filesystem::path& out,
                   std::vector<std::unique_ptr<Stage>> stages, const ReplayOptions& options)
    : options_(options), reader_(in), writer_(out), beginnings_(stages.size()), inboxes_(stages.size()) {
  require_our_log(reader_);
  for (std::unique_ptr<Stage>& stage : stages) {
    runners_.push_back(std::make_unique<StageRunner>(std::move(stage), *this));
    if (options.timing) runners_.back()->measure_time();
    route(runners_.size() - 1);
  }
  index_ = index_logs({&reader_}, [&](std::string_view channel) {
    const std::string name(channel);
    if (std::find(options.ignored_channels.begin(), options.ignored_channels.end(), name) !=
        options.ignored_channels.end())
      return false;
    const bool is_read = routes_.contains(name) && (options_.from_s || !producers_.contains(name));
    return is_read || is_copied(name) || (options_.from_s && name.starts_with("STATE_"));
  });
  for (const auto& runner : runners_) require_clock(*runner);
  pass_over_stray_stamps();
  if (!options_.from_s) return;
  for (std::size_t stage = 0; stage < runners_.size(); ++stage) begin_at_snapshot(stage);
}

bool Replayer::is_copied(const std::string& channel) const {
  const auto& copied = options_.copied_channels;
  return std::find(copied.begin(), copied.end(), channel) != copied.end();
}

void Replayer::pass_over_stray_stamps() {
  std::vector<std::vector<Stamp>> stamps(index_.channels.size());
  std::vector<Stamp> all;  // as one channel: what is far from everything, though on its own channel nothing contradicts
  for (const IndexedMessage& m : index_.messages) {
    stamps[static_cast<std::size_t>(m.channel)].push_back({m.header.run, m.header.seq, m.header.utime});
    all.push_back({0, 0, m.header.utime});
  }
  const std::vector<StampError> far = stray_stamps(all);
  std::vector<std::vector<StampError>> errors;
  for (const std::vector<Stamp>& channel : stamps) errors.push_back(stray_stamps(channel));
  std::vector<std::size_t> next(index_.channels.size());
  bool any = false;
  for (const IndexedMessage& m : index_.messages) {
    const auto channel = static_cast<std::size_t>(m.channel);
    const StampError error = errors[channel][next[channel]++];
    const bool is_far = error == StampError::kFar || far[passed_over_.size()] == StampError::kFar;
    const bool stray = error == StampError::kEarly || is_far;
    passed_over_.push_back(stray);
    if (stray) {
      ++summary_.passed_over[index_.channels[channel]];
    } else {
      if (!any) first_ = m.header;
      last_ = m.header;
      any = true;
    }
  }
}

void Replayer::begin_at_snapshot(std::size_t stage) {
  StageRunner& runner = *runners_[stage];
  const int channel = index_.channel(stage_channel("STATE_", runner.spec().name));
  const int64_t until = first_.utime + std::llround(*options_.from_s * 1e6);
  const MessageCheck check = Schema::built_in().check_of("state_t");
  const IndexedMessage* last = nullptr;
  for (const IndexedMessage& message : index_.messages) {
    if (message.channel != channel || message.header.utime > until) continue;
    if (check(reader_.at(message.offset).data) == CheckResult::kOk) last = &message;
  }
  if (last == nullptr) {
    throw std::runtime_error(reader_.path().string() + ": no snapshot of " + runner.spec().name + " in the first " +
                             std::to_string(*options_.from_s) + " s");
  }
  const auto state = decode<state_t>(reader_.at(last->offset).data);
  runner.resume(state);
  int64_t delay_us = 0;
  for (const InputSpec& input : runner.spec().inputs) delay_us = std::max(delay_us, input.effect_delay_us);
  beginnings_[stage] = {state.horizon_utime - delay_us, state.utime};
}

void Replayer::route(std::size_t stage) {
  const StageSpec& spec = runners_[stage]->spec();
  for (int input = 0; input < static_cast<int>(spec.inputs.size()); ++input) {
    const Route route{stage, input, delivery_order(spec, input)};
    routes_[spec.inputs[static_cast<std::size_t>(input)].channel].push_back(route);
  }
  for (const OutputSpec& output : spec.outputs) {
    if (!producers_.emplace(output.channel, stage).second) {
      throw std::logic_error("two stages publish " + output.channel);
    }
  }
}

void Replayer::require_clock(const StageRunner& runner) const {
  std::string clocks;
  bool broken = false;
  for (const ClockSpec& clock : runner.spec().clocks) {
    const std::string& channel = runner.spec().inputs[static_cast<std::size_t>(clock.input)].channel;
    if (producers_.contains(channel)) return;
    const int number = index_.channel(channel);
    for (const IndexedMessage& message : index_.messages) {
      if (message.channel != number) continue;
      if (runner.can_decode(clock.input, reader_.at(message.offset).data)) return;
      broken = true;
    }
    clocks += (clocks.empty() ? "" : ", ") + channel;
  }
  std::string text = reader_.path().string() + ": " + runner.spec().name + " needs a message on " + clocks;
  text += broken ? ", and the log has none that can be decoded" : ", and the log has none";
  // The first damage may be why; a thousand more add nothing.
  if (const std::vector<LogDamage>& damage = reader_.damage(); !damage.empty()) {
    text += "; it is damaged at byte " + std::to_string(damage[0].offset) + " (" + damage[0].what + ")";
    if (damage.size() > 1) text += " and in " + std::to_string(damage.size() - 1) + " more places";
  }
  throw std::runtime_error(text);
}

ReplaySummary Replayer::run() {
  const std::vector<IndexedMessage>& messages = index_.messages;
  std::size_t next_report = 0;
  for (std::size_t begin = 0, end = 0; begin < messages.size(); begin = end) {
    utime_ = messages[begin].header.utime;
    while (end < messages.size() && messages[end].header.utime == utime_) ++end;
    dispatch(begin, end);
    if (options_.progress && begin >= next_report) {
      options_.progress(static_cast<double>(begin) / static_cast<double>(messages.size()));
      next_report = begin + messages.size() / 100 + 1;
    }
  }
  writer_.commit(options_.to_disk);
  if (options_.progress) options_.progress(1.0);
  return summary();
}

/// All messages of one utime, stage by stage.
void Replayer::dispatch(std::size_t begin, std::size_t end) {
  for (std::size_t i = begin; i < end; ++i) {
    const IndexedMessage& message = index_.messages[i];
    const std::string& channel = index_.channels[static_cast<std::size_t>(message.channel)];
    const std::span<const uint8_t> data = reader_.at(message.offset).data;
    if (is_copied(channel)) {
      writes_.push_back({channel, message.header.seq, {data.begin(), data.end()}});
    }
    const auto found = routes_.find(channel);
    if (found == routes_.end() || passed_over_[i]) continue;
    const auto producer = producers_.find(channel);
    if (producer != producers_.end() && utime_ > beginnings_[producer->second].outputs_after) continue;
    for (const Route& route : found->second) {
      if (utime_ <= beginnings_[route.stage].inputs_after) continue;
      inboxes_[route.stage].push_back({route.order, route.input, data, {}});
    }
  }
  for (std::size_t stage = 0; stage < runners_.size(); ++stage) {
    std::vector<Delivery>& inbox = inboxes_[stage];
    std::stable_sort(inbox.begin(), inbox.end(),
                     [](const Delivery& a, const Delivery& b) { return a.order < b.order; });
    for (const Delivery& delivery : inbox) runners_[stage]->offer(delivery.input, delivery.bytes);
    summary_.messages += static_cast<int64_t>(inbox.size());
    inbox.clear();
  }
  write_group();
}

void Replayer::put(const std::string& channel, const Header& header, std::span<const uint8_t> bytes) {
  if (header.utime != utime_) throw std::logic_error(channel + ": an output that is not for now");
  writes_.push_back({channel, header.seq, {bytes.begin(), bytes.end()}});
  const auto found = routes_.find(channel);
  if (found == routes_.end()) return;
  for (const Route& route : found->second) {
    Delivery delivery{route.order, route.input, {}, {bytes.begin(), bytes.end()}};
    delivery.bytes = delivery.own;
    inboxes_[route.stage].push_back(std::move(delivery));
  }
}

void Replayer::write_group() {
  std::stable_sort(writes_.begin(), writes_.end(), [](const Write& a, const Write& b) {
    return std::tie(a.channel, a.seq) < std::tie(b.channel, b.seq);
  });
  for (const Write& write : writes_) writer_.write(write.channel, utime_, write.bytes);
  summary_.outputs += static_cast<int64_t>(writes_.size());
  writes_.clear();
}

ReplaySummary Replayer::summary() const {
  ReplaySummary summary = summary_;
  summary.data_s = (static_cast<double>(last_.utime) - static_cast<double>(first_.utime)) * 1e-6;
  summary.damage = reader_.damage();
  for (const auto& runner : runners_) {
    const StageSpec& spec = runner->spec();
    for (std::size_t i = 0; i < spec.inputs.size(); ++i) {
      const InputCounters& counters = runner->stream().track(static_cast<int>(i)).counters;
      summary.inputs.push_back({spec.name, spec.inputs[i].channel, counters});
    }
    if (runner->timing() == nullptr) continue;
    for (HandlerTiming::Row& row : runner->timing()->rows()) summary.timing.push_back(std::move(row));
  }
  return summary;
}

}  // namespace

ReplaySummary replay(const std::filesystem::path& in, const std::filesystem::path& out,
                     std::vector<std::unique_ptr<Stage>> stages, const ReplayOptions& options) {
  refuse_to_replace(in, out);
  return Replayer(in, out, std::move(stages), options).run();
}

}  // namespace roadfix
