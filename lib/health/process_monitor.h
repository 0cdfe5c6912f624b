/// One process by its heartbeats: alive, running, keeping up.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "health/health_config.h"
#include "health/recent.h"
#include "health/verdict.h"

namespace roadfix {

enum class ProcessState { kStarting, kRunning, kNoClock, kDegraded, kStopping };

struct HeartbeatFacts {
  int64_t run = 0;
  ProcessState state = ProcessState::kStarting;
  std::string reason;  ///< of the state, plain words
  double cpu_share = 0.0;
  int64_t rss_bytes = 0;
  int64_t kernel_drops = 0;
  double queue_age_s = 0.0;  ///< of the input that waits longest
  std::string queue_channel;
  int32_t queue_depth = 0;  ///< all inputs together
};

struct ProcessReport {
  std::string name;
  std::optional<HeartbeatFacts> newest;
  double age_s = -1.0;  ///< since the newest heartbeat; -1: none yet
  int restarts = 0;
  bool silent = false;
};

class ProcessMonitor {
 public:
  /// `expected`: the vehicle has it; another one is missed only once it has shown that it lives.
  /// `several`: it may run more than once side by side.
  ProcessMonitor(const std::string& name, const ProcessLimits& limits, bool expected = false, bool several = false)
      : name_(name), limits_(limits), expected_(expected), several_(several) {}

  void heartbeat(int64_t now_us, const HeartbeatFacts& facts);
  void check(int64_t now_us, int64_t start_us, std::vector<Condition>& out) const;
  [[nodiscard]] ProcessReport report(int64_t now_us) const;

 private:
  [[nodiscard]] bool silent(int64_t now_us) const;
  [[nodiscard]] double silent_after() const;
  [[nodiscard]] Condition condition(const std::string& what, const std::string& text) const;
  void check_load(int64_t now_us, std::vector<Condition>& out) const;
  void change_run(int64_t now_us, int64_t run);

  std::string name_;
  ProcessLimits limits_;
  bool expected_, several_;
  std::optional<HeartbeatFacts> newest_;
  int64_t first_us_ = 0;  ///< of this run
  int64_t now_us_ = 0;
  int64_t previous_run_ = 0;
  std::deque<int64_t> intervals_us_;  ///< between the last few heartbeats
  int restarts_ = 0;
  Recent drops_, restarted_, run_alternations_;
};

}  // namespace roadfix
