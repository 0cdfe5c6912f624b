#include "monitor/health_publisher.h"

#include <cmath>
#include <iostream>

#include "bus/types/message.h"
#include "monitor/messages.h"

namespace roadfix {

namespace {
constexpr int64_t kHeartbeat_us = 1'000'000;
/// Longer than from one heartbeat to the next.
constexpr int64_t kListen_us = 1'200'000;
/// An older monitor that published nothing for so long is gone.
constexpr int64_t kGone_us = 3'000'000;
}  // namespace

HealthPublisher::HealthPublisher(Bus& bus, double period_s, std::optional<int64_t> started_us)
    : bus_(bus),
      period_us_(std::llround(period_s * 1e6)),
      live_(started_us.has_value()),
      run_(started_us.value_or(0)) {}

void HealthPublisher::decided(const HealthReport& report, bool changed) {
  if (run_ == 0) run_ = report.now_us;
  if (listens_since_us_ == 0) listens_since_us_ = report.now_us;
  if (must_be_silent(report.now_us)) return;
  if (changed || report.now_us - published_us_ >= period_us_) {
    published_us_ = report.now_us;
    health_t message = health_message(report);
    message.utime = report.now_us;
    message.run = run_;
    message.seq = seq_++;
    bus_.publish("HEALTH", encode(message));
  }
  if (live_ && report.now_us - heartbeat_us_ >= kHeartbeat_us) publish_heartbeat(report.now_us);
}

void HealthPublisher::received(const BusMessage& message, int64_t now_us) {
  if (message.channel != "HEALTH" && message.channel != "HEARTBEAT_MONITOR") return;
  const std::optional<Header> header = read_header(message.bytes);
  if (!header || header->run >= run_) return;
  if (!other_us_ || now_us - *other_us_ > kGone_us)
    std::cerr << "monitor: another monitor publishes HEALTH here; this one only shows" << std::endl;
  other_us_ = now_us;
}

bool HealthPublisher::must_be_silent(int64_t now_us) const {
  if (!live_) return false;
  return now_us - listens_since_us_ < kListen_us || (other_us_ && now_us - *other_us_ <= kGone_us);
}

void HealthPublisher::publish_heartbeat(int64_t now_us) {
  heartbeat_us_ = now_us;
  heartbeat_t heartbeat{};
  heartbeat.utime = now_us;
  heartbeat.run = run_;
  heartbeat.seq = heartbeat_seq_++;
  unsent_.note(now_us, bus_.unsent());
  heartbeat.state_reason = unsent_.state_reason(now_us);
  heartbeat.state = heartbeat.state_reason.empty() ? heartbeat_t::STATE_RUNNING : heartbeat_t::STATE_DEGRADED;
  heartbeat.cpu_share = load_.cpu_share();
  heartbeat.rss_bytes = resident_bytes();
  heartbeat.kernel_drops = bus_.kernel_drops();
  bus_.publish("HEARTBEAT_MONITOR", encode(heartbeat));
}

}  // namespace roadfix
