/// Estimates the lateness of live inputs for the horizon: 1.5 times the second largest lateness of a channel in the
/// last 10 to 20 s of data, at least kMinLateness_us, at most the specified lateness. A single late message is given
/// up.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "stream/spec.h"

namespace roadfix {

class LatenessEstimator {
 public:
  explicit LatenessEstimator(const std::vector<InputSpec>& inputs);

  /// An input other than the clock, received at the clock time `clock_utime`. Lateness above the channel's
  /// specification is ignored.
  void note(int input, int64_t clock_utime, int64_t utime);

  /// The new lateness to allow, if changed: increases take effect at once, decreases after a full window.
  std::optional<int64_t> change(int64_t clock_utime);

  [[nodiscard]] int64_t allowed_us() const { return allowed_us_; }

  static constexpr int64_t kWindow_us = 10'000'000;
  static constexpr int64_t kStep_us = 10'000;

 private:
  struct Latest {
    std::array<int64_t, 2> us{};  ///< the largest and second largest of a window
    void add(int64_t lateness_us);
  };
  [[nodiscard]] int64_t required_us() const;

  std::vector<int64_t> stated_us_;
  int64_t most_us_ = 0;
  int64_t allowed_us_ = 0;
  std::optional<int64_t> window_;  ///< its number
  std::vector<Latest> now_, before_;
};

}  // namespace roadfix
