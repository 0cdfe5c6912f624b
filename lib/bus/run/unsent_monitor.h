/// Counts messages that the network did not take, and gives the reason for the heartbeat: of what other processes never
/// got, this is the only trace.
#pragma once

#include <cstdint>
#include <string>

namespace roadfix {

class UnsentMonitor {
 public:
  /// `unsent`: the bus's count (Bus::unsent()).
  void note(int64_t now_utime, int64_t unsent) {
    if (unsent <= unsent_) return;
    unsent_ = unsent;
    until_us_ = now_utime + kReported_us;
  }
  /// Empty where all was sent, and once some heartbeats have come through again.
  [[nodiscard]] std::string state_reason(int64_t now_utime) const {
    return now_utime < until_us_ ? "the network did not take " + std::to_string(unsent_) + " messages" : std::string();
  }

 private:
  static constexpr int64_t kReported_us = 3'000'000;

  int64_t unsent_ = 0;
  int64_t until_us_ = 0;
};

}  // namespace roadfix
