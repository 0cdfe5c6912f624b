#include "bus/live_stage.h"

#include <algorithm>
#include <roadfix/config_t.hpp>

namespace roadfix {

namespace {
constexpr int64_t kHeartbeat_us = 1'000'000;
constexpr int64_t kConfig_us = 10'000'000;
/// Without a tick for this long a stage says so; shorter gaps are ordinary.
constexpr int64_t kNoClock_us = 1'000'000;
}  // namespace

LiveStage::LiveStage(std::unique_ptr<Stage> stage, Bus& bus)
    : bus_(bus), runner_(std::make_unique<StageRunner>(std::move(stage), *this)) {
  runner_->measure_time();
  started_us_ = clock_.now_utime();
  const std::vector<InputSpec>& inputs = runner_->spec().inputs;
  for (int i = 0; i < static_cast<int>(inputs.size()); ++i) {
    bus_.subscribe(inputs[static_cast<std::size_t>(i)].channel, [this, i](const BusMessage& message) {
      if (runner_->offer(i, message.bytes) == Offer::kTick) last_tick_us_ = clock_.now_utime();
    });
  }
}

bool LiveStage::step(std::chrono::milliseconds patience) {
  publish_due();
  const bool more = bus_.handle(patience);
  publish_due();
  return more;
}

void LiveStage::publish_due() {
  const int64_t now = clock_.now_utime();
  if (now >= next_config_us_) {
    publish_config(now);
    next_config_us_ = now + kConfig_us;
  }
  if (now >= next_heartbeat_us_) {
    publish_heartbeat(now, false);
    next_heartbeat_us_ = now + kHeartbeat_us;
  }
}

void LiveStage::stop() { publish_heartbeat(clock_.now_utime(), true); }

void LiveStage::put(const std::string& channel, const Header&, std::span<const uint8_t> bytes) {
  bus_.publish(channel, bytes);
}

std::pair<int8_t, std::string> LiveStage::state(int64_t now_utime) const {
  const InputStream& stream = runner_->stream();
  if (now_utime - std::max(last_tick_us_, started_us_) > kNoClock_us) {
    std::string clocks;
    for (const ClockSpec& clock : runner_->spec().clocks) {
      clocks += (clocks.empty() ? "" : ", ") + runner_->spec().inputs[static_cast<std::size_t>(clock.input)].channel;
    }
    return {heartbeat_t::STATE_NO_CLOCK, "no newer sample on " + clocks};
  }
  if (!stream.clock_utime()) return {heartbeat_t::STATE_STARTING, "waits for its clock"};
  for (std::size_t i = 0; i < runner_->spec().inputs.size(); ++i) {
    if (stream.track(static_cast<int>(i)).counters.conflicts > 0) {
      return {heartbeat_t::STATE_DEGRADED,
              runner_->spec().inputs[i].channel + ": two publishers, or a log played again with old names"};
    }
  }
  return {heartbeat_t::STATE_RUNNING, ""};
}

void LiveStage::publish_heartbeat(int64_t now_utime, bool stopping) {
  heartbeat_t heartbeat{};
  heartbeat.utime = now_utime;
  heartbeat.run = clock_.run();
  heartbeat.seq = heartbeat_seq_++;
  std::tie(heartbeat.state, heartbeat.state_reason) = state(now_utime);
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
