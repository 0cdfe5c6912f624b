/// Which inputs a stage that is too slow for them passes over: all but the newest. Once more of them wait than its
/// patience, everything is skipped up to the one behind which nothing waits. What has one utime (a stereo pair) is
/// taken or skipped as one.
#pragma once

#include <cstdint>
#include <map>

#include "stream/spec.h"

namespace roadfix {

class OverloadChoice {
 public:
  explicit OverloadChoice(OverloadSpec spec) : spec_(std::move(spec)) {}

  [[nodiscard]] bool concerns(int input) const;

  /// Of a message that is about to be taken, with `waiting` newer ones of its channel behind it.
  bool skips(int input, int64_t utime, int64_t waiting);

 private:
  OverloadSpec spec_;
  bool overloaded_ = false;
  std::map<int64_t, bool> decided_;  // by utime, for the other picture of a pair
};

}  // namespace roadfix
