#include "stream/overload_choice.h"

#include <algorithm>

namespace roadfix {

namespace {
/// The pictures of a pair are not further apart than this many others.
constexpr std::size_t kRemembered = 64;
}  // namespace

bool OverloadChoice::concerns(int input) const {
  return std::find(spec_.inputs.begin(), spec_.inputs.end(), input) != spec_.inputs.end();
}

bool OverloadChoice::skips(int input, int64_t utime, int64_t waiting) {
  if (!concerns(input)) return false;
  if (waiting > spec_.patience) overloaded_ = true;
  if (waiting == 0) overloaded_ = false;
  const bool skips = decided_.emplace(utime, overloaded_).first->second;
  if (decided_.size() > kRemembered) decided_.erase(decided_.begin());
  return skips;
}

}  // namespace roadfix
