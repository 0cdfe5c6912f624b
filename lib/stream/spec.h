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
  int64_t lateness_us = 0;      ///< maximum lateness behind the clock
  int64_t effect_delay_us = 0;  ///< feedback: applied at utime + this, refused when later
};

/// A channel that may drive the stage's time; the next in the list takes over after its time-out.
struct ClockSpec {
  int input = 0;           ///< index into the inputs
  int64_t timeout_us = 0;  ///< in data time
};

/// Live inputs that a stage may skip under overload, recorded in its ledger.
struct OverloadSpec {
  std::vector<int> inputs;
  int64_t max_waiting = 2;  ///< newer messages before skipping starts
};

/// Limits of the horizon behind the clock: upper limit by default, lower limit of the estimate.
inline int64_t largest_lateness_us(const std::vector<InputSpec>& inputs) {
  int64_t largest_us = 0;
  for (const InputSpec& input : inputs) largest_us = std::max(largest_us, input.lateness_us);
  return largest_us;
}
inline constexpr int64_t kMinLateness_us = 100'000;

/// Identity and time of a message.
struct EventId {
  int64_t utime = 0;
  int64_t run = 0;  ///< names one start of the publisher
  int64_t seq = 0;  ///< +1 per message of a run
};

}  // namespace roadfix
