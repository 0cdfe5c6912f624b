/// A stage on a bus: subscribes to its inputs, publishes its outputs, and its state once a second and on change.
///
/// The wall clock is read for heartbeats and configuration messages only; what the stage computes is the runner's, and
/// so the same as in replay. What it decides by arrival (which frames to skip under overload, when to restart) the
/// ledger records; how late its inputs may be, where the stage asks for that (horizon_input()), it publishes in a
/// message that is an input as well.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <roadfix/heartbeat_t.hpp>
#include <set>
#include <string>

#include "bus/bus.h"
#include "bus/run/backward_stamp_detector.h"
#include "bus/run/process_facts.h"
#include "bus/run/run_clock.h"
#include "bus/run/stage_memory.h"
#include "bus/run/stage_runner.h"
#include "bus/run/unsent_monitor.h"
#include "stream/lateness_estimator.h"
#include "stream/overload_skipper.h"

namespace roadfix {

class LiveStage : public MessageSink {
 public:
  /// `bus` must outlive it. Subscribes at once.
  LiveStage(std::function<std::unique_ptr<Stage>()> make, Bus& bus);

  /// Keeps the memory of the stage in this file, and begins with what is there (bus/run/stage_memory.h).
  /// Before the first step(). Throws std::runtime_error where the file cannot be used; the stage then begins without.
  void keep_memory_in(const std::filesystem::path& file);

  /// Handles what comes within `timeout`, and publishes what is due. False when the bus has ended.
  bool step(std::chrono::milliseconds timeout);

  /// Saves the memory, and publishes the last heartbeat: stopping.
  void stop();

  [[nodiscard]] const StageRunner& runner() const { return *runner_; }

 private:
  void put(const std::string& channel, const Header& header, std::span<const uint8_t> bytes) override;
  void take(int input, std::span<const uint8_t> bytes);
  [[nodiscard]] bool is_clock(int input) const;
  [[nodiscard]] bool jumps_ahead(int input, int64_t utime);
  void restart(int64_t utime);
  void publish_memory(int64_t first_utime);
  void begin_horizon(int64_t first_utime);
  void allow_lateness(int64_t utime, int64_t lateness_us);
  void update_lateness(int input, int64_t utime);
  void save_memory();
  void publish_due();
  void publish_heartbeat(int64_t now_utime, bool stopping);
  void fill_inputs(heartbeat_t& heartbeat);
  void publish_config(int64_t now_utime);
  void check_counters(int64_t now_utime);
  [[nodiscard]] std::pair<int8_t, std::string> state(int64_t now_utime) const;
  [[nodiscard]] std::pair<int8_t, std::string> state_of_inputs(int64_t now_utime) const;

  Bus& bus_;
  RunClock clock_;
  ProcessLoad load_;
  std::function<std::unique_ptr<Stage>()> make_;
  std::unique_ptr<StageRunner> runner_;
  OverloadSkipper overload_;
  LatenessEstimator lateness_;
  BackwardStampDetector backward_stamps_;
  std::optional<int64_t> horizon_run_;  ///< of our messages on HORIZON_<PROCESS>; none before the first clock sample
  int64_t horizon_seq_ = 0;
  std::string restart_reason_;  ///< of the run, where it is not the first
  std::set<int64_t> runs_;      ///< names given before
  std::filesystem::path memory_file_;
  std::optional<state_t> memory_;  ///< until the first clock sample
  std::string memory_error_;
  int64_t started_us_ = 0;
  int64_t last_tick_us_ = 0;            ///< of the run clock, when the newest tick came
  std::vector<InputCounters> counted_;  ///< at the last check
  UnsentMonitor unsent_;
  std::string warning_;
  int64_t warning_until_us_ = 0;
  int8_t reported_state_ = -1;
  int64_t next_check_us_ = 0;
  int64_t next_heartbeat_us_ = 0;
  int64_t next_config_us_ = 0;
  int64_t heartbeat_seq_ = 0;
  int64_t config_seq_ = 0;
};

}  // namespace roadfix
