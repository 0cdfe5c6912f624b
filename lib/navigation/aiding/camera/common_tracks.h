/// The tracks that two pictures have in common.
#pragma once

#include <cstddef>

namespace roadfix::navigation {

inline constexpr size_t kEnoughCommon = 10;  ///< tracks, for a median or a share of them

/// visit(then, now) for every track in both lists, which ascend by `track`.
template <class Then, class Now, class Visit>
void for_each_common(const Then& then, const Now& now, const Visit& visit) {
  auto old = then.begin();
  for (const auto& seen : now) {
    while (old != then.end() && old->track < seen.track) ++old;
    if (old != then.end() && old->track == seen.track) visit(*old, seen);
  }
}

}  // namespace roadfix::navigation
