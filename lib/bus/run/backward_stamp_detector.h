/// Distinguishes stamps that have gone back (a log played again, a corrected clock) from stray, broken and forged
/// messages: so many in a row of one publisher, each later than the one before, and all of them far behind the clock.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "bus/types/message.h"

namespace roadfix {

class BackwardStampDetector {
 public:
  explicit BackwardStampDetector(std::size_t inputs) : sequences_(inputs) {}

  /// A message of this input that is behind `clock_utime`; true where the stamps have gone back.
  bool detect(int input, const Header& header, int64_t clock_utime) {
    if (!is_plausible(header) || header.utime > clock_utime - kBehind_us) return false;
    Sequence& sequence = sequences_[static_cast<std::size_t>(input)];
    if (sequence.count > 0 && (header.run != sequence.run || header.utime <= sequence.utime)) sequence.count = 0;
    sequence = {sequence.count + 1, header.run, header.utime};
    return sequence.count >= kConsecutive;
  }
  /// The clock went on.
  void reset() {
    for (Sequence& sequence : sequences_) sequence.count = 0;
  }

 private:
  static constexpr int64_t kBehind_us = 10'000'000;
  static constexpr int kConsecutive = 5;

  struct Sequence {
    int count = 0;
    int64_t run = 0, utime = 0;
  };
  std::vector<Sequence> sequences_;
};

}  // namespace roadfix
