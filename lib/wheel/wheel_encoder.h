/// Speeds of wheels from the readings of their counters (MODEL.md, (W.3.1)): how far a counter went between two readings
/// is a mean speed, of the middle of the interval.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

namespace roadfix {

struct EncoderConfig {
  double ticks_per_turn = 0.0;
  double wheel_radius = 0.0;  ///< m, rolling
  /// The counter's range: from wraps_at - 1 it goes to 0, or half of it below and above. 0: all of 64 bits.
  uint64_t wraps_at = 0;
  double max_gap = 1.0;  ///< s; a longer interval has no speed worth the name
};

/// From one reading to the next the shorter way round: a wheel turns less than half the counter's range in between.
int64_t tick_difference(int64_t from, int64_t to, uint64_t wraps_at);

struct EncoderReading {
  int64_t t_us = 0;
  int num_wheels = 1;
  std::array<int64_t, 4> ticks{};  ///< the first num_wheels count
};

struct EncoderSpeeds {
  int64_t t_us = 0;               ///< middle of the interval
  std::array<double, 4> speed{};  ///< m/s, of the wheels of the reading
};

class WheelEncoder {
 public:
  explicit WheelEncoder(const EncoderConfig& config) : config_(config) {}

  /// Nothing for the first reading, for one that is not later than the last, and behind a gap.
  std::optional<EncoderSpeeds> add(const EncoderReading& reading);
  /// The next reading is a first one.
  void restart() { last_.reset(); }

 private:
  EncoderConfig config_;
  std::optional<EncoderReading> last_;
};

}  // namespace roadfix
