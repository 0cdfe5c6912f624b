#include "roadfix/fleet/progress.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "roadfix/fleet/run_task.h"
#include "roadfix/fleet/task_work.h"

namespace roadfix {
namespace {

namespace fs = std::filesystem;

fs::file_time_type written_at(const fs::path& path) {
  std::error_code ignored;
  const fs::file_time_type time = fs::last_write_time(path, ignored);
  return ignored ? fs::file_time_type::min() : time;
}

std::string what_differs(const TaskKey& key, const FleetPlan& plan, const FleetTask& task) {
  if (key.build != plan.build) return fmt::format("of build {}, now {}", key.build, plan.build);
  if (key.config != plan.configs.at(task.config).digest) return "of another configuration";
  if (key.request != request_digest(plan, task)) return "of other stages or options";
  return "of another input";
}

std::string why_missing(const RunFolder& run, std::size_t index, bool& at_work) {
  const TaskBegun state = begun(run, index);
  at_work = state.running;
  if (state.who.empty()) return "not begun";
  return state.running ? "at work: " + state.who : "ended without a word, killed perhaps: " + state.who;
}

}  // namespace

std::vector<TaskStatus> survey(const RunFolder& run, const FleetPlan& plan) {
  std::vector<TaskStatus> out;
  for (FleetTask& task : run.tasks()) {
    TaskStatus status{std::move(task), TaskState::kMissing, ""};
    const std::optional<ResultHead> head = run.head(status.task.index);
    if (!head) {
      status.why = why_missing(run, status.task.index, status.at_work);
    } else if (!head->ok) {
      status.state = TaskState::kFailed;
      status.why = head->reason;
    } else {
      try {
        const bool done = is_done(run, plan, status.task);
        status.state = done ? TaskState::kOk : TaskState::kStale;
        if (!done) status.why = what_differs(head->key, plan, status.task);
      } catch (const std::exception& e) {
        status.state = TaskState::kStale;
        status.why = e.what();
      }
    }
    out.push_back(std::move(status));
  }
  return out;
}

std::size_t count(const std::vector<TaskStatus>& tasks, TaskState state) {
  return static_cast<std::size_t>(
      std::count_if(tasks.begin(), tasks.end(), [&](const TaskStatus& t) { return t.state == state; }));
}

std::optional<double> time_left(const RunFolder& run, const std::vector<TaskStatus>& tasks) {
  std::vector<fs::file_time_type> ended;
  for (const TaskStatus& t : tasks) {
    if (t.state == TaskState::kOk || t.state == TaskState::kFailed)
      ended.push_back(written_at(run.result_path(t.task.index)));
  }
  const bool at_work = std::any_of(tasks.begin(), tasks.end(), [](const TaskStatus& t) { return t.at_work; });
  if (ended.size() < 2 || !at_work) return std::nullopt;
  const auto [first, last] = std::minmax_element(ended.begin(), ended.end());
  const double each_s = std::chrono::duration<double>(*last - *first).count() / static_cast<double>(ended.size() - 1);
  return each_s * static_cast<double>(tasks.size() - ended.size());
}

FleetProgress::FleetProgress(const RunFolder& run, const std::vector<std::size_t>& waiting)
    : run_(run), all_(waiting.size()) {
  for (const std::size_t index : waiting) waiting_.push_back({index, written_at(run.result_path(index))});
}

bool FleetProgress::look() {
  const std::size_t before = waiting_.size();
  std::erase_if(waiting_, [&](const Awaited& awaited) {
    if (written_at(run_.result_path(awaited.index)) == awaited.before) return false;
    const std::optional<ResultHead> head = run_.head(awaited.index);
    if (!head) return false;
    ++(head->ok ? ok_ : failed_);
    for (const char* words : {"disk full", "No space left"}) {
      if (head->reason.find(words) != std::string::npos) disk_full_ = true;
    }
    return true;
  });
  return waiting_.size() != before;
}

double FleetProgress::share() const {
  return all_ == 0 ? 1.0 : static_cast<double>(done()) / static_cast<double>(all_);
}

std::string FleetProgress::line() const {
  const double elapsed_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
  std::string text = fmt::format("{} of {} done", done(), all_);
  if (failed_ > 0) text += fmt::format(", {} of them failed", failed_);
  text += ", " + duration_text(elapsed_s);
  if (done() > 0 && done() < all_) {
    const double left_s = elapsed_s / static_cast<double>(done()) * static_cast<double>(all_ - done());
    text += fmt::format(", about {} left", duration_text(left_s));
  }
  return text;
}

std::string duration_text(double seconds) {
  const auto whole = static_cast<long>(std::lround(seconds));
  if (whole < 120) return fmt::format("{} s", whole);
  if (whole < 7200) return fmt::format("{} min", (whole + 30) / 60);
  return fmt::format("{} h {:02} min", whole / 3600, whole % 3600 / 60);
}

}  // namespace roadfix
