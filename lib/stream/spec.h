/// What a stage declares about its inputs.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

namespace roadfix {

struct InputSpec {
  std::string channel;
  std::string type;             ///< for example "imu_t"
  int64_t lateness_us = 0;      ///< how far behind the clock it may arrive and still count
  int64_t effect_delay_us = 0;  ///< feedback: applied at utime + this, and refused when it comes later than that
};

/// A channel that may drive the stage's time; the next in the list takes over where it is silent for its time-out.
struct ClockSpec {
  int input = 0;           ///< index into the inputs
  int64_t timeout_us = 0;  ///< in data time
};

/// Inputs that a stage may pass over, live, when they come faster than it works; it says so in its ledger.
struct OverloadSpec {
  std::vector<int> inputs;
  int64_t patience = 2;  ///< newer ones that may wait before skipping begins
};

/// What a horizon may be behind the clock: the most, where nothing else was said; and at least, whatever was measured.
inline int64_t largest_lateness_us(const std::vector<InputSpec>& inputs) {
  int64_t largest_us = 0;
  for (const InputSpec& input : inputs) largest_us = std::max(largest_us, input.lateness_us);
  return largest_us;
}
inline constexpr int64_t kLeastLateness_us = 100'000;

/// Names one message of a channel and says when it is valid.
struct EventId {
  int64_t utime = 0;
  int64_t run = 0;  ///< names one start of the publisher
  int64_t seq = 0;  ///< +1 per message of a run
};

}  // namespace roadfix
