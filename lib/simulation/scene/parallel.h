/// How a caller lends its threads: runs task(0) to task(count - 1), in any order, on any threads, and returns when all
/// are done. Results never depend on the schedule, because each task writes its own part only.
#pragma once

#include <functional>

namespace roadfix {

using ParallelFor = std::function<void(int count, const std::function<void(int)>& task)>;

/// On the calling thread.
inline void serial_for(int count, const std::function<void(int)>& task) {
  for (int i = 0; i < count; ++i) task(i);
}

}  // namespace roadfix
