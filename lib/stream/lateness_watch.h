/// How late a stage's inputs come, live, and what its horizon should allow for: half as much again as the second latest
/// of a channel in the last 10 to 20 s of data, at least kLeastLateness_us, never more than is stated for the channels.
/// One straggler is given up rather than waited for by everything else.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "stream/spec.h"

namespace roadfix {

class LatenessWatch {
 public:
  explicit LatenessWatch(const std::vector<InputSpec>& inputs);

  /// An input that is no clock now, when the clock stood at `clock_utime`. What came later than is stated for its
  /// channel says nothing: no horizon waits for it.
  void note(int input, int64_t clock_utime, int64_t utime);

  /// What to allow from now on, where it is another than before: more at once, less when a window has shown that it
  /// was not needed.
  std::optional<int64_t> change(int64_t clock_utime);

  [[nodiscard]] int64_t allowed_us() const { return allowed_us_; }

  static constexpr int64_t kWindow_us = 10'000'000;
  static constexpr int64_t kStep_us = 10'000;

 private:
  struct Latest {
    std::array<int64_t, 2> us{};  ///< the latest and the second latest of a window
    void add(int64_t lateness_us);
  };
  [[nodiscard]] int64_t wanted_us() const;

  std::vector<int64_t> stated_us_;
  int64_t most_us_ = 0;
  int64_t allowed_us_ = 0;
  std::optional<int64_t> window_;  ///< its number
  std::vector<Latest> now_, before_;
};

}  // namespace roadfix
