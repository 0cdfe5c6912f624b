/// One task in a process of its own, so that whatever ends it costs it alone and is reported in its result.
#pragma once

#include <cstddef>

#include "roadfix/fleet/run_folder.h"

namespace roadfix {

enum class TaskEnd {
  kOk,
  kFailed,       ///< the result says why
  kStood,        ///< its result stands already
  kElsewhere,    ///< another process is at it
  kInterrupted,  ///< by SIGINT or SIGTERM: no result
  kNoResult      ///< not even a failure could be written
};

/// Runs the task unless its result stands: in a child that SIGKILL ends at the time limit, with a scratch folder that
/// is gone afterwards. Call block_task_signals() first, in a process without threads.
TaskEnd run_task(const RunFolder& run, const FleetPlan& plan, std::size_t index);

/// SIGCHLD, SIGINT and SIGTERM are then taken by run_task() alone.
void block_task_signals();

/// Words for the task's output and the engine's log.
const char* to_words(TaskEnd end);

/// Who is at the task or was last, where it has no result: "HOST, process PID, since TIME". Empty where nobody began.
struct TaskBegun {
  bool running = false;  ///< the lock is held; on this file system's word
  std::string who;
};
TaskBegun begun(const RunFolder& run, std::size_t index);

}  // namespace roadfix
