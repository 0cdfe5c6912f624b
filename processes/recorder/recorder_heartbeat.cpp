#include "recorder/recorder_heartbeat.h"

#include <fmt/format.h>

#include <roadfix/heartbeat_t.hpp>
#include <stdexcept>

#include "bus/run/stage_runner.h"
#include "bus/types/message.h"

namespace roadfix {

RecorderHeartbeat::RecorderHeartbeat(const std::string& name) : channel_(stage_channel("HEARTBEAT_", name)) {
  constexpr std::size_t kMost = 40;
  if (!name.empty() && name.size() <= kMost &&
      name.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789_") == std::string::npos) {
    return;
  }
  throw std::invalid_argument("recorder.yaml: name '" + name + "' is none: lower-case letters, digits and _, at most " +
                              std::to_string(kMost));
}

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
  if (const std::string unsent = unsent_.state_reason(heartbeat.utime); !unsent.empty()) say(unsent);
  heartbeat.state = reason.empty() ? heartbeat_t::STATE_RUNNING : heartbeat_t::STATE_DEGRADED;
  bus.publish(channel_, encode(heartbeat));
}

}  // namespace roadfix
