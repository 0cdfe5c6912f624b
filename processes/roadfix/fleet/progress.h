/// How far a run has come.
#pragma once

#include <chrono>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "roadfix/fleet/run_folder.h"

namespace roadfix {

enum class TaskState {
  kOk,
  kFailed,
  kStale,   ///< a result of another input, configuration, build or request
  kMissing  ///< no result
};

struct TaskStatus {
  FleetTask task;
  TaskState state = TaskState::kMissing;
  std::string why;  ///< of all but ok
  bool at_work = false;
};

/// Of every task, compared with what the plan says now; reads an input where its stamp is another one.
std::vector<TaskStatus> survey(const RunFolder& run, const FleetPlan& plan);

std::size_t count(const std::vector<TaskStatus>& tasks, TaskState state);

/// How long the missing tasks will take at the pace at which results came, s; nothing where no task is at work or fewer
/// than two results are there.
std::optional<double> time_left(const RunFolder& run, const std::vector<TaskStatus>& tasks);

/// Counts results as they appear and says how long the rest will take at the pace so far.
class FleetProgress {
 public:
  /// `waiting`: tasks that have been handed out; a result counts once it is another file than it was.
  FleetProgress(const RunFolder& run, const std::vector<std::size_t>& waiting);

  /// Looks; true where something new has ended.
  bool look();
  [[nodiscard]] std::size_t done() const { return ok_ + failed_; }
  [[nodiscard]] std::size_t failed() const { return failed_; }
  [[nodiscard]] bool disk_full() const { return disk_full_; }
  [[nodiscard]] double share() const;
  [[nodiscard]] std::string line() const;

 private:
  struct Awaited {
    std::size_t index;
    std::filesystem::file_time_type before;  ///< of the result that was there; the epoch without one
  };
  RunFolder run_;
  std::vector<Awaited> waiting_;
  std::size_t all_;
  std::size_t ok_ = 0;
  std::size_t failed_ = 0;
  bool disk_full_ = false;
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

/// 45 s, 12 min, 3 h 05 min
std::string duration_text(double seconds);

}  // namespace roadfix
