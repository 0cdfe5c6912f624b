/// Selects the inputs that a stage skips under overload: all but the newest. Once more than max_waiting of them wait,
/// everything is skipped up to the last one. Messages of one utime (a stereo pair) are processed or skipped together.
#pragma once

#include <cstdint>
#include <map>

#include "stream/spec.h"

namespace roadfix {

class OverloadSkipper {
 public:
  explicit OverloadSkipper(OverloadSpec spec) : spec_(std::move(spec)) {}

  [[nodiscard]] bool concerns(int input) const;

  /// For a message about to be processed, with `waiting` newer ones of its channel behind it.
  bool skips(int input, int64_t utime, int64_t waiting);

 private:
  OverloadSpec spec_;
  bool overloaded_ = false;
  std::map<int64_t, bool> decided_;  // by utime, for the other image of a pair
};

}  // namespace roadfix
