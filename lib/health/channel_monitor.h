/// One channel: how often, how late, how complete, and whether that is as it should be.
///
/// Two clocks: `now` is the listener's (of a log: when the message was recorded), `utime` the message's own stamp. A
/// drive that is played again has stamps of another day: `lag` is the usual difference of the two, the same for all
/// channels.
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

struct Arrival {
  int64_t now_us = 0;
  int64_t utime = 0;
  int64_t run = 0;
  int64_t seq = 0;
  std::size_t bytes = 0;
  std::optional<uint64_t> content;  ///< a digest of the payload, of channels that never repeat a value
};

struct ChannelReport {
  std::string name;
  double rate_hz = 0.0;
  std::optional<double> expected_hz;
  double jitter_s = 0.0;   ///< standard deviation of the time between two arrivals
  double latency_s = 0.0;  ///< median from stamp to arrival
  double age_s = -1.0;     ///< since the newest arrival; -1: none yet
  int64_t received = 0;
  int64_t lost = 0;
  int64_t undecodable = 0;
  bool silent = false;
};

class ChannelMonitor {
 public:
  ChannelMonitor(const std::string& name, const ChannelLimits& limits, std::optional<double> expected_hz);

  void arrived(const Arrival& arrival);
  void undecodable(int64_t now_us, const std::string& why);
  /// A message in order whose values are no numbers, or impossible.
  void unusable(int64_t now_us) { unusable_.add(now_us); }

  /// Median of arrival minus stamp; absent before the first arrival and for channels that are not periodic.
  [[nodiscard]] std::optional<int64_t> lag_us() const;
  /// Whether something came lately, so that its stamps are still of use.
  [[nodiscard]] bool is_fresh(int64_t now_us) const;

  /// `start_us`: when what is expected should have appeared. `if_silent`: how bad it is when the channel falls silent.
  void check(int64_t now_us, int64_t start_us, int64_t lag_us, Verdict if_silent, std::vector<Condition>& out);
  [[nodiscard]] ChannelReport report(int64_t now_us, int64_t lag_us) const;

 private:
  struct ArrivalTimes {
    int64_t now_us = 0;
    int64_t utime = 0;
  };

  void count_sequence(const Arrival& arrival);
  void detect_stamp_jump(const Arrival& arrival);
  void learn_rate(int64_t now_us);
  [[nodiscard]] double rate_hz(int64_t now_us) const;
  [[nodiscard]] bool silent(int64_t now_us) const;
  [[nodiscard]] double silent_after() const;
  [[nodiscard]] double jitter_s() const;
  [[nodiscard]] Condition condition(const std::string& what, Verdict verdict, const std::string& text) const;
  void check_rate(int64_t now_us, std::vector<Condition>& out) const;
  void check_stamps(int64_t now_us, int64_t lag_us, std::vector<Condition>& out) const;
  void check_contents(int64_t now_us, std::vector<Condition>& out) const;

  std::string name_;
  ChannelLimits limits_;
  bool periodic_;
  bool configured_;
  std::optional<double> expected_hz_;
  bool relearn_rate_ = true;
  std::optional<int64_t> faster_since_us_;  ///< than expected
  std::deque<ArrivalTimes> window_;
  int64_t first_us_ = 0;  ///< of the run
  int64_t run_ = 0, previous_run_ = 0, seq_ = 0;
  int64_t received_ = 0;
  Recent lost_, undecodable_, unusable_, run_changes_, stamp_jumps_;
  double stamp_jump_s_ = 0.0;
  std::string why_undecodable_;
  std::optional<uint64_t> content_;
  int64_t content_since_us_ = 0;
  int content_messages_ = 0;
};

/// False for channels that come when something happens, not at a rate.
bool is_periodic(const std::string& channel);

}  // namespace roadfix
