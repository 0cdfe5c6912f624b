/// Tells stamps that have gone back (a log played again, a corrected clock) from stray, broken and forged messages: so
/// many messages in a row of one publisher, each later than the one before, and all of them far behind the clock.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "bus/types/message.h"

namespace roadfix {

class StepBack {
 public:
  explicit StepBack(std::size_t inputs) : seen_(inputs) {}

  /// A message of this input that is behind `clock_utime`; true where the stamps have gone back.
  bool confirmed_by(int input, const Header& header, int64_t clock_utime) {
    if (!is_plausible(header) || header.utime > clock_utime - kBehind_us) return false;
    Seen& seen = seen_[static_cast<std::size_t>(input)];
    if (seen.count > 0 && (header.run != seen.run || header.utime <= seen.utime)) seen.count = 0;
    seen = {seen.count + 1, header.run, header.utime};
    return seen.count >= kInARow;
  }
  /// The clock went on.
  void forget() {
    for (Seen& seen : seen_) seen.count = 0;
  }

 private:
  static constexpr int64_t kBehind_us = 10'000'000;
  static constexpr int kInARow = 5;

  struct Seen {
    int count = 0;
    int64_t run = 0, utime = 0;
  };
  std::vector<Seen> seen_;
};

}  // namespace roadfix
