/// HEARTBEAT_RECORDER: degraded once something did not reach the disk, or the bus.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "bus/bus.h"
#include "bus/run/process_facts.h"
#include "bus/run/run_clock.h"
#include "bus/run/unsent_monitor.h"

namespace roadfix {

class RecorderHeartbeat {
 public:
  /// `name`: of the process; throws std::invalid_argument where it can be none.
  explicit RecorderHeartbeat(const std::string& name = "recorder");

  /// `dropped`: messages per channel that did not fit into memory; `stopped`: why nothing is recorded.
  void publish(Bus& bus, RunClock& clock, const std::map<std::string, int64_t>& dropped,
               const std::optional<std::string>& stopped);

 private:
  std::string channel_;
  ProcessLoad load_;
  UnsentMonitor unsent_;
  int64_t seq_ = 0;
};

}  // namespace roadfix
