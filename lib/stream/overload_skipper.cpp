#include "stream/overload_skipper.h"

#include <algorithm>

namespace roadfix {

namespace {
/// Limit on messages between the images of a pair.
constexpr std::size_t kRemembered = 64;
}  // namespace

bool OverloadSkipper::concerns(int input) const {
  return std::find(spec_.inputs.begin(), spec_.inputs.end(), input) != spec_.inputs.end();
}

bool OverloadSkipper::skips(int input, int64_t utime, int64_t waiting) {
  if (!concerns(input)) return false;
  if (waiting > spec_.max_waiting) overloaded_ = true;
  if (waiting == 0) overloaded_ = false;
  const bool skips = decided_.emplace(utime, overloaded_).first->second;
  if (decided_.size() > kRemembered) decided_.erase(decided_.begin());
  return skips;
}

}  // namespace roadfix
