/// A stage on a bus: subscribes to its inputs, publishes its outputs, and once a second says how it is.
///
/// The wall clock is read for heartbeats and configuration messages only; what the stage computes is the runner's, and
/// so the same as in replay.
#pragma once

#include <map>
#include <memory>
#include <roadfix/heartbeat_t.hpp>
#include <string>

#include "bus/bus.h"
#include "bus/process_facts.h"
#include "bus/run_clock.h"
#include "bus/stage_runner.h"

namespace roadfix {

class LiveStage : public MessageSink {
 public:
  /// `bus` must outlive it. Subscribes at once.
  LiveStage(std::unique_ptr<Stage> stage, Bus& bus);

  /// Handles what comes within `patience`, and publishes what is due. False when the bus has ended.
  bool step(std::chrono::milliseconds patience);

  /// The last heartbeat: stopping.
  void stop();

  [[nodiscard]] const StageRunner& runner() const { return *runner_; }

 private:
  void put(const std::string& channel, const Header& header, std::span<const uint8_t> bytes) override;
  void publish_due();
  void publish_heartbeat(int64_t now_utime, bool stopping);
  void fill_inputs(heartbeat_t& heartbeat);
  void publish_config(int64_t now_utime);
  std::pair<int8_t, std::string> state(int64_t now_utime) const;

  Bus& bus_;
  RunClock clock_;
  ProcessLoad load_;
  std::unique_ptr<StageRunner> runner_;
  int64_t started_us_ = 0;
  int64_t last_tick_us_ = 0;  ///< of the run clock, when the newest tick came
  int64_t next_heartbeat_us_ = 0;
  int64_t next_config_us_ = 0;
  int64_t heartbeat_seq_ = 0;
  int64_t config_seq_ = 0;
};

}  // namespace roadfix
