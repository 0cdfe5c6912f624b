#include "bus/run/live_stage.h"

#include <algorithm>
#include <cstdlib>
#include <roadfix/config_t.hpp>
#include <roadfix/horizon_t.hpp>

namespace roadfix {

namespace {
constexpr int64_t kHeartbeat_us = 1'000'000;
constexpr int64_t kConfig_us = 10'000'000;
/// A change of state is reported soon after it happened, not with the next heartbeat.
constexpr int64_t kCheck_us = 100'000;
/// What a message caused (two publishers, an overload) is reported for this long.
constexpr int64_t kWarning_us = 700'000;
/// Without a tick for this long a stage reports it; shorter gaps are ordinary.
constexpr int64_t kNoClock_us = 1'000'000;
}  // namespace

LiveStage::LiveStage(std::function<std::unique_ptr<Stage>()> make, Bus& bus)
    : bus_(bus),
      make_(std::move(make)),
      runner_(std::make_unique<StageRunner>(make_(), *this)),
      overload_(runner_->spec().overload),
      lateness_(runner_->spec().inputs),
      backward_stamps_(runner_->spec().inputs.size()) {
  runner_->measure_time();
  started_us_ = clock_.now_utime();
  const std::vector<InputSpec>& inputs = runner_->spec().inputs;
  for (int i = 0; i < static_cast<int>(inputs.size()); ++i) {
    bus_.subscribe(inputs[static_cast<std::size_t>(i)].channel,
                   [this, i](const BusMessage& message) { take(i, message.bytes); });
  }
}

void LiveStage::take(int input, std::span<const uint8_t> bytes) {
  const std::optional<Header> header = read_header(bytes);
  if (header && overload_.concerns(input)) {
    const std::vector<QueueStatus> queues = bus_.queues();
    const auto i = static_cast<std::size_t>(input);
    if (overload_.skips(input, header->utime, i < queues.size() ? queues[i].depth : 0)) {
      runner_->skip(input, bytes);
      return;
    }
  }
  if (header && is_plausible(*header) && is_clock(input)) {
    if (jumps_ahead(input, header->utime) && runner_->can_decode(input, bytes)) restart(header->utime);
    if (memory_) publish_memory(header->utime);
    begin_horizon(header->utime);
  }
  const Offer offer = runner_->offer(input, bytes);
  if ((offer == Offer::kWaits || offer == Offer::kLate) && input != horizon_input(runner_->spec())) {
    update_lateness(input, header->utime);
  }
  if (offer == Offer::kTick) {
    last_tick_us_ = clock_.now_utime();
    backward_stamps_.reset();
    return;
  }
  const std::optional<int64_t> now = runner_->stream().clock_utime();
  if (offer == Offer::kWaits || !header || !now || !is_clock(input) || !runner_->can_decode(input, bytes)) return;
  if (!backward_stamps_.detect(input, *header, *now)) return;
  restart(header->utime);
  begin_horizon(header->utime);
  runner_->offer(input, bytes);
}

/// Whether the stamps have gone ahead, and not the time: after a silence as long as their leap the stage goes on.
bool LiveStage::jumps_ahead(int input, int64_t utime) {
  const InputStream& stream = runner_->stream();
  if (!stream.confirms_jump(input, utime)) return false;
  const int64_t silent_us = clock_.now_utime() - last_tick_us_;
  return utime - *stream.clock_utime() - silent_us > ClockSelector::kJump_us / 2;
}

void LiveStage::keep_memory_in(const std::filesystem::path& file) {
  if (memory_input(runner_->spec()) < 0) return;
  memory_file_ = file;
  memory_ = read_memory(file, runner_->spec());
}

/// As old as the horizon will be after the first clock sample: the first input to be applied.
void LiveStage::publish_memory(int64_t first_utime) {
  memory_->utime = first_utime - largest_lateness_us(runner_->spec().inputs);
  memory_->run = clock_.run();
  memory_->seq = 0;
  const std::vector<uint8_t> bytes = encode(*memory_);
  memory_.reset();
  bus_.publish(stage_channel("START_", runner_->spec().name), bytes);
  runner_->offer(memory_input(runner_->spec()), bytes);
}

/// Counts from the second clock sample on; without such an input in the log, replay allows the largest lateness.
void LiveStage::begin_horizon(int64_t first_utime) {
  if (horizon_run_ || horizon_input(runner_->spec()) < 0) return;
  horizon_run_ = clock_.now_utime();
  allow_lateness(first_utime - largest_lateness_us(runner_->spec().inputs), lateness_.allowed_us());
}

void LiveStage::allow_lateness(int64_t utime, int64_t lateness_us) {
  horizon_t horizon{};
  horizon.utime = utime;
  horizon.run = *horizon_run_;
  horizon.seq = horizon_seq_++;
  horizon.lateness_us = lateness_us;
  const std::vector<uint8_t> bytes = encode(horizon);
  bus_.publish(stage_channel("HORIZON_", runner_->spec().name), bytes);
  runner_->offer(horizon_input(runner_->spec()), bytes);
}

void LiveStage::update_lateness(int input, int64_t utime) {
  const std::optional<int64_t> now = runner_->stream().clock_utime();
  if (!horizon_run_ || !now) return;
  lateness_.note(input, *now, utime);
  if (const std::optional<int64_t> lateness_us = lateness_.change(*now)) allow_lateness(*now, *lateness_us);
}

void LiveStage::save_memory() {
  if (memory_file_.empty() || !runner_->stream().clock_utime()) return;
  state_t memory{};
  memory.state = runner_->stage().memory();
  if (memory.state.empty()) return;
  memory.size_bytes = static_cast<int32_t>(memory.state.size());
  memory.horizon_utime = *runner_->stream().horizon_utime();
  memory.process = runner_->spec().name;
  memory.layout = runner_->spec().state_layout;
  try {
    write_memory(memory_file_, memory);
    memory_error_.clear();
  } catch (const std::runtime_error& e) {
    memory_error_ = e.what();  // the drive goes on without
  }
}

bool LiveStage::is_clock(int input) const {
  const std::vector<ClockSpec>& clocks = runner_->spec().clocks;
  return std::any_of(clocks.begin(), clocks.end(), [&](const ClockSpec& clock) { return clock.input == input; });
}

/// A new run, as if the process had been started anew. A log may be played for the third time: no two runs have one
/// name.
void LiveStage::restart(int64_t utime) {
  const int64_t ahead_us = utime - *runner_->stream().clock_utime();
  runs_.insert(*runner_->stream().run());
  runner_ = std::make_unique<StageRunner>(make_(), *this);
  runner_->measure_time();
  int64_t name = utime;
  while (runs_.contains(name)) ++name;
  runner_->name_run(name);
  overload_ = OverloadSkipper(runner_->spec().overload);
  lateness_ = LatenessEstimator(runner_->spec().inputs);
  horizon_run_.reset();
  backward_stamps_.reset();
  restart_reason_ = std::string("the stamps went ") + (ahead_us > 0 ? "ahead" : "back") + " by " +
                    std::to_string(std::abs(ahead_us) / 1'000'000) + " s: a new run";
}

bool LiveStage::step(std::chrono::milliseconds timeout) {
  publish_due();
  const bool more = bus_.handle(timeout);
  publish_due();
  return more;
}

void LiveStage::publish_due() {
  const int64_t now = clock_.now_utime();
  if (now >= next_config_us_) {
    publish_config(now);
    save_memory();
    next_config_us_ = now + kConfig_us;
  }
  if (now >= next_check_us_) {
    next_check_us_ = now + kCheck_us;
    check_counters(now);
    if (state(now).first != reported_state_) next_heartbeat_us_ = now;
  }
  if (now >= next_heartbeat_us_) {
    check_counters(now);
    publish_heartbeat(now, false);
    next_heartbeat_us_ = now + kHeartbeat_us;
  }
}

void LiveStage::stop() {
  save_memory();
  check_counters(clock_.now_utime());
  publish_heartbeat(clock_.now_utime(), true);
}

void LiveStage::put(const std::string& channel, const Header&, std::span<const uint8_t> bytes) {
  bus_.publish(channel, bytes);
}

/// Compares the counters with those of the last check: what happened once and is over is no warning any more.
void LiveStage::check_counters(int64_t now_utime) {
  const std::vector<InputSpec>& inputs = runner_->spec().inputs;
  counted_.resize(inputs.size());
  for (std::size_t i = inputs.size(); i-- > 0;) {  // of several the first one's is reported
    const InputCounters& counters = runner_->stream().track(static_cast<int>(i)).counters;
    if (counters.skipped > counted_[i].skipped) {
      warning_ = inputs[i].channel + ": too fast for this stage, " + std::to_string(counters.skipped) + " skipped";
      warning_until_us_ = now_utime + kWarning_us;
    }
    if (counters.conflicts > counted_[i].conflicts) {
      warning_ = inputs[i].channel + ": two publishers, or a log played again with old names";
      warning_until_us_ = now_utime + kWarning_us;
    }
    counted_[i] = counters;
  }
  unsent_.note(now_utime, bus_.unsent());
}

/// A network that is gone takes the inputs with it: what was not sent is reported beside other reasons.
std::pair<int8_t, std::string> LiveStage::state(int64_t now_utime) const {
  std::pair<int8_t, std::string> all = state_of_inputs(now_utime);
  const std::string unsent = unsent_.state_reason(now_utime);
  if (unsent.empty()) return all;
  if (all.first == heartbeat_t::STATE_RUNNING) all.first = heartbeat_t::STATE_DEGRADED;
  all.second += (all.second.empty() ? "" : "; ") + unsent;
  return all;
}

std::pair<int8_t, std::string> LiveStage::state_of_inputs(int64_t now_utime) const {
  const InputStream& stream = runner_->stream();
  if (now_utime - std::max(last_tick_us_, started_us_) > kNoClock_us) {
    std::string clocks;
    for (const ClockSpec& clock : runner_->spec().clocks) {
      clocks += (clocks.empty() ? "" : ", ") + runner_->spec().inputs[static_cast<std::size_t>(clock.input)].channel;
    }
    return {heartbeat_t::STATE_NO_CLOCK, "no newer sample on " + clocks};
  }
  if (!stream.clock_utime()) return {heartbeat_t::STATE_STARTING, "waits for its clock"};
  if (now_utime < warning_until_us_) return {heartbeat_t::STATE_DEGRADED, warning_};
  if (!memory_error_.empty()) return {heartbeat_t::STATE_DEGRADED, memory_error_};
  return {heartbeat_t::STATE_RUNNING, restart_reason_};
}

void LiveStage::publish_heartbeat(int64_t now_utime, bool stopping) {
  heartbeat_t heartbeat{};
  heartbeat.utime = now_utime;
  heartbeat.run = clock_.run();
  heartbeat.seq = heartbeat_seq_++;
  std::tie(heartbeat.state, heartbeat.state_reason) = state(now_utime);
  reported_state_ = heartbeat.state;
  if (stopping) heartbeat.state = heartbeat_t::STATE_STOPPING;
  heartbeat.cpu_share = load_.cpu_share();
  heartbeat.rss_bytes = resident_bytes();
  heartbeat.kernel_drops = bus_.kernel_drops();
  fill_inputs(heartbeat);
  const std::vector<uint8_t> bytes = encode(heartbeat);
  bus_.publish(stage_channel("HEARTBEAT_", runner_->spec().name), bytes);
}

void LiveStage::fill_inputs(heartbeat_t& heartbeat) {
  const InputStream& stream = runner_->stream();
  const std::vector<QueueStatus> queues = bus_.queues();
  const std::vector<double> p99_s = runner_->take_apply_p99_s();
  const int64_t clock_us = stream.clock_utime().value_or(0);
  for (std::size_t i = 0; i < runner_->spec().inputs.size(); ++i) {
    const InputTrack& track = stream.track(static_cast<int>(i));
    const InputCounters& counters = track.counters;
    const QueueStatus queue = i < queues.size() ? queues[i] : QueueStatus{};
    heartbeat.input_channel.push_back(runner_->spec().inputs[i].channel);
    const int64_t age_us = track.newest_utime > 0 ? clock_us - track.newest_utime : 0;
    heartbeat.input_age_s.push_back(static_cast<double>(age_us) * 1e-6);
    heartbeat.input_received.push_back(counters.received);
    heartbeat.input_applied.push_back(counters.applied);
    heartbeat.input_lost.push_back(counters.lost);
    heartbeat.input_late.push_back(counters.late);
    heartbeat.input_duplicate.push_back(counters.duplicate);
    heartbeat.input_undecodable.push_back(counters.undecodable);
    heartbeat.input_refused.push_back(counters.refused);
    heartbeat.input_skipped.push_back(counters.skipped);
    heartbeat.input_queue_depth.push_back(queue.depth);
    const int64_t waits_us = queue.oldest_us > 0 ? heartbeat.utime - queue.oldest_us : 0;
    heartbeat.input_queue_age_s.push_back(static_cast<double>(waits_us) * 1e-6);
    heartbeat.input_handler_p99_s.push_back(p99_s[i]);
  }
  heartbeat.num_inputs = static_cast<int32_t>(heartbeat.input_channel.size());
}

void LiveStage::publish_config(int64_t now_utime) {
  config_t config = runner_->config_message();
  config.utime = now_utime;
  config.run = clock_.run();
  config.seq = config_seq_++;
  bus_.publish(stage_channel("CONFIG_", runner_->spec().name), encode(config));
}

}  // namespace roadfix
