#include "recorder/recorder_heartbeat.h"

#include <fmt/format.h>

#include <roadfix/heartbeat_t.hpp>

#include "bus/message.h"

namespace roadfix {

void RecorderHeartbeat::publish(Bus& bus, RunClock& clock, const std::map<std::string, int64_t>& dropped,
                                const std::optional<std::string>& stopped) {
  heartbeat_t heartbeat{};
  heartbeat.utime = clock.now_utime();
  heartbeat.run = clock.run();
  heartbeat.seq = seq_++;
  heartbeat.kernel_drops = bus.kernel_drops();
  heartbeat.cpu_share = load_.cpu_share();
  heartbeat.rss_bytes = resident_bytes();
  int64_t lost = 0;
  for (const auto& [channel, count] : dropped) lost += count;
  for (const QueueStatus& queue : bus.queues()) lost += queue.dropped;
  unsent_.note(heartbeat.utime, bus.unsent());

  std::string& reason = heartbeat.state_reason;
  const auto say = [&](const std::string& text) { reason += (reason.empty() ? "" : "; ") + text; };
  if (stopped) say("not recording: " + *stopped);
  if (lost > 0 || heartbeat.kernel_drops > 0) {
    say(fmt::format("{} messages did not fit into memory, the kernel dropped {} datagrams", lost,
                    heartbeat.kernel_drops));
  }
  if (const std::string unsent = unsent_.trouble(heartbeat.utime); !unsent.empty()) say(unsent);
  heartbeat.state = reason.empty() ? heartbeat_t::STATE_RUNNING : heartbeat_t::STATE_DEGRADED;
  bus.publish("HEARTBEAT_RECORDER", encode(heartbeat));
}

}  // namespace roadfix
