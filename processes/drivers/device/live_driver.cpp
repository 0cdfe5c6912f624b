#include "drivers/device/live_driver.h"

#include <roadfix/config_t.hpp>
#include <roadfix/heartbeat_t.hpp>
#include <roadfix/raw_t.hpp>

#include "bus/run/stage_runner.h"
#include "config/config_hash.h"

namespace roadfix {

namespace {
constexpr int64_t kHeartbeat_us = 1'000'000;
constexpr int64_t kConfig_us = 10'000'000;
}  // namespace

LiveDriver::LiveDriver(const DriverSetup& setup, Bus& bus)
    : setup_(setup),
      bus_(bus),
      outputs_(bus),
      reader_(setup, outputs_),
      session_([this] { return setup_.open([this] { return clock_.now_utime(); }); }, setup.device),
      raw_seq_(setup.raw_channels.size()) {
  if (setup_.make_companion) companion_ = setup_.make_companion();
}

bool LiveDriver::step(std::chrono::milliseconds timeout) {
  publish_due();
  packets_.clear();
  if (session_.step(DeviceSession::Clock::now(), timeout, packets_)) {
    for (std::size_t i = 0; i < raw_seq_.size(); ++i) take(static_cast<int>(i), clock_.now_utime(), {});
  }
  const int64_t now = clock_.now_utime();
  for (const Packet& packet : packets_) take(packet.stream, packet.utime != 0 ? packet.utime : now, packet.bytes);
  if (companion_ && reader_.driver() != nullptr) {
    companion_->step(now, *reader_.driver(), session_.source());
    if (const std::vector<uint8_t> bytes = companion_->take_received(); !bytes.empty()) {
      publish_raw(companion_->raw_channel(), companion_seq_, now, bytes);
    }
  }
  return !session_.ended();
}

/// Raw bytes and driver see the same numbers, so that a replay sees them too.
void LiveDriver::take(int stream, int64_t utime, std::span<const uint8_t> bytes) {
  const auto i = static_cast<std::size_t>(stream);
  const Header header{utime, clock_.run(), raw_seq_[i]};
  if (setup_.publish_raw) {
    publish_raw(setup_.raw_channels[i], raw_seq_[i], utime, bytes);
  } else {
    ++raw_seq_[i];
  }
  reader_.take(stream, header, bytes);
}

void LiveDriver::publish_raw(const std::string& channel, int64_t& seq, int64_t utime, std::span<const uint8_t> bytes) {
  raw_t raw{};
  raw.utime = utime;
  raw.run = clock_.run();
  raw.seq = seq++;
  raw.device = session_.name();
  raw.size_bytes = static_cast<int32_t>(bytes.size());
  raw.data.assign(bytes.begin(), bytes.end());
  bus_.publish(channel, encode(raw));
}

void LiveDriver::publish_due() {
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

std::string LiveDriver::state_reason() {
  std::string text = session_.state_reason(DeviceSession::Clock::now());
  if (text.empty() && reader_.driver() != nullptr) text = reader_.driver()->state_reason(clock_.now_utime());
  if (text.empty() && companion_) text = companion_->state_reason();
  return text;
}

void LiveDriver::stop() { publish_heartbeat(clock_.now_utime(), true); }

void LiveDriver::publish_heartbeat(int64_t now_utime, bool stopping) {
  heartbeat_t h{};
  h.utime = now_utime;
  h.run = clock_.run();
  h.seq = heartbeat_seq_++;
  h.state_reason = state_reason();
  unsent_.note(now_utime, bus_.unsent());
  if (const std::string unsent = unsent_.state_reason(now_utime); !unsent.empty()) {
    h.state_reason += (h.state_reason.empty() ? "" : "; ") + unsent;
  }
  h.state = h.state_reason.empty() ? heartbeat_t::STATE_RUNNING : heartbeat_t::STATE_DEGRADED;
  if (session_.openings() == 0) h.state = heartbeat_t::STATE_STARTING;
  if (stopping) h.state = heartbeat_t::STATE_STOPPING;
  h.cpu_share = load_.cpu_share();
  h.rss_bytes = resident_bytes();
  h.kernel_drops = bus_.kernel_drops();
  const std::vector<StreamCounters> rows =
      reader_.driver() ? reader_.driver()->counters() : std::vector<StreamCounters>();
  for (const StreamCounters& row : rows) {
    h.input_channel.push_back(row.name);
    h.input_age_s.push_back(row.newest_utime > 0 ? static_cast<double>(now_utime - row.newest_utime) * 1e-6 : 0.0);
    h.input_received.push_back(row.received);
    h.input_applied.push_back(row.used);
    h.input_lost.push_back(0);
    h.input_late.push_back(row.late);
    h.input_duplicate.push_back(0);
    h.input_undecodable.push_back(row.bad_checksum);
    h.input_refused.push_back(row.refused);
    h.input_queue_depth.push_back(0);
    h.input_queue_age_s.push_back(0.0);
    h.input_handler_p99_s.push_back(0.0);
    h.input_skipped.push_back(row.skipped_bytes);
  }
  h.num_inputs = static_cast<int32_t>(rows.size());
  bus_.publish(stage_channel("HEARTBEAT_", setup_.name), encode(h));
}

void LiveDriver::publish_config(int64_t now_utime) {
  config_t c{};
  c.utime = now_utime;
  c.run = clock_.run();
  c.seq = config_seq_++;
  c.process = setup_.name;
  c.config_yaml = setup_.config;
  c.config_hash = config_hash(setup_.config, "");
  c.build_id = build_id();
  c.library_versions = library_versions();
  c.cpu_features = cpu_features();
  bus_.publish(stage_channel("CONFIG_", setup_.name), encode(c));
}

}  // namespace roadfix
