#include "roadfix/fleet/run_task.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/statvfs.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iostream>

#include "bus/run/process_facts.h"
#include "config/config_error.h"
#include "roadfix/fleet/input_digest.h"
#include "roadfix/fleet/task_inputs.h"
#include "roadfix/fleet/task_lock.h"
#include "roadfix/fleet/task_work.h"

namespace roadfix {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using Clock = std::chrono::steady_clock;

constexpr int kChildFailed = 1;
constexpr std::size_t kMaxReason = 2000;  ///< characters

fs::path lock_path(const RunFolder& run, std::size_t index) { return run.task_folder(index) / "lock"; }

/// The same for every attempt at a task on a machine, so that the next one clears what a killed one left.
fs::path scratch_of(const RunFolder& run, const FleetPlan& plan, std::size_t index) {
  const std::string name =
      fmt::format("roadfix-fleet-{}-{}-{:06}", ::getuid(), text_digest(run.path().string()).substr(0, 8), index);
  return (plan.scratch.empty() ? fs::temp_directory_path() : plan.scratch) / name;
}

class ScratchFolder {
 public:
  explicit ScratchFolder(fs::path path) : path_(std::move(path)) {
    clear();
    fs::create_directories(path_);
    fs::permissions(path_, fs::perms::owner_all);
  }
  ~ScratchFolder() { clear(); }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  [[nodiscard]] const fs::path& path() const { return path_; }

 private:
  void clear() const {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  fs::path path_;
};

/// Throws where a disk has no room left for a task: before anything is written, not in the middle of it.
void require_room(const fs::path& folder, int64_t min_free_mb) {
  struct statvfs disk {};
  if (::statvfs(folder.c_str(), &disk) != 0) return;
  const auto free_mb = static_cast<int64_t>(disk.f_bavail) * static_cast<int64_t>(disk.f_frsize) / 1'000'000;
  if (free_mb >= min_free_mb) return;
  throw std::runtime_error(fmt::format("disk full: {} has {} MB left, a task begins with {} (--min-free-mb)",
                                       folder.string(), free_mb, min_free_mb));
}

/// Throws where the result would be one of something else than what was planned.
void require_as_planned(const FleetPlan& plan, const FleetTask& task) {
  if (build_id() != plan.build) {
    throw std::runtime_error(
        fmt::format("this roadfix is of build {}, the run is of build {}: `roadfix fleet resume` "
                    "with one of them takes it for all",
                    build_id(), plan.build));
  }
  const FleetConfig& config = plan.configs.at(task.config);
  if (config_digest(config, root_here(plan)) != config.digest) {
    throw std::runtime_error(
        fmt::format("{}: has changed since the run was planned; `roadfix fleet resume` takes it as "
                    "it is now, for all",
                    config.path));
  }
}

/// The child's whole life. Whatever it prints goes to the file that the parent reads where it fails.
[[noreturn]] void child_life(const RunFolder& run, const FleetPlan& plan, const FleetTask& task,
                             const fs::path& scratch, int attempt) {
  const pid_t parent = ::getppid();
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) std::_Exit(kChildFailed);
  sigset_t none;
  sigemptyset(&none);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
  const int out = ::open((scratch / "said.txt").c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  if (out >= 0) {
    ::dup2(out, STDOUT_FILENO);
    ::dup2(out, STDERR_FILENO);
  }
  int status = 0;
  try {
    const TaskKey key = task_key(plan, task);
    Json result = {{"index", task.index}, {"name", task.name}, {"host", host_name()}, {"attempt", attempt}};
    result.update(do_task(run, plan, task, key, scratch));
    run.write_result(task.index, result);
  } catch (const std::exception& e) {
    std::cerr << e.what() << std::endl;
    status = kChildFailed;
  }
  std::cout.flush();
  std::_Exit(status);
}

/// How the child was waited for: its status, or why it was killed.
struct Waited {
  int status = 0;
  bool timed_out = false;
  bool interrupted = false;
};

Waited wait_for(pid_t child, double time_limit_s) {
  const auto end =
      Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(time_limit_s));
  sigset_t awaited;
  sigemptyset(&awaited);
  for (const int signal : {SIGCHLD, SIGINT, SIGTERM}) sigaddset(&awaited, signal);
  Waited waited;
  while (::waitpid(child, &waited.status, WNOHANG) == 0) {
    const auto left = std::chrono::duration_cast<std::chrono::nanoseconds>(end - Clock::now()).count();
    if (left > 0) {
      const timespec patience{left / 1'000'000'000, left % 1'000'000'000};
      const int signal = ::sigtimedwait(&awaited, nullptr, &patience);
      waited.interrupted = signal == SIGINT || signal == SIGTERM;
    } else {
      waited.timed_out = true;
    }
    if (!waited.interrupted && !waited.timed_out) continue;
    ::kill(child, SIGKILL);
    while (::waitpid(child, &waited.status, 0) < 0 && errno == EINTR) {
    }
    return waited;
  }
  return waited;
}

/// The last words, where there are many.
std::string said_in(const fs::path& scratch) {
  std::ifstream stream(scratch / "said.txt");
  std::string text((std::istreambuf_iterator<char>(stream)), std::istreambuf_iterator<char>());
  while (!text.empty() && text.back() == '\n') text.pop_back();
  return text.size() > kMaxReason ? "..." + text.substr(text.size() - kMaxReason) : text;
}

std::string reason_of(const Waited& waited, const FleetPlan& plan, const fs::path& scratch) {
  const std::string said = said_in(scratch);
  if (waited.timed_out) return fmt::format("killed at its time limit of {} s (--time-limit-s)", plan.time_limit_s);
  if (WIFSIGNALED(waited.status)) {
    const int signal = WTERMSIG(waited.status);
    std::string why = fmt::format("killed by signal {} ({})", signal, ::strsignal(signal));
    if (signal == SIGKILL) why += ", by hand or for want of memory";
    return said.empty() ? why : why + ": " + said;
  }
  return said.empty() ? fmt::format("ended with status {} without a word", WEXITSTATUS(waited.status)) : said;
}

/// A failure as a result. False where it cannot be written either.
bool write_failure(const RunFolder& run, const FleetTask& task, const std::string& reason, double wall_s, int attempt) {
  const Json result = {
      {"index", task.index},      {"name", task.name}, {"host", host_name()},   {"attempt", attempt},
      {"status", "failed"},       {"reason", reason},  {"key", Json::object()}, {"cost", {{"wall_s", wall_s}}},
      {"figures", Json::object()}};
  try {
    run.write_result(task.index, result);
    return true;
  } catch (const std::exception& e) {
    std::cerr << fmt::format("task {}: {}\ntask {}: not even that could be written: {}\n", task.index, reason,
                             task.index, e.what());
    return false;
  }
}

/// The task's own process, from its begin to its end.
class Attempt {
 public:
  Attempt(const RunFolder& run, const FleetPlan& plan, const FleetTask& task)
      : run_(run), plan_(plan), task_(task), begin_(Clock::now()) {
    const std::optional<ResultHead> head = run.head(task.index);
    number_ = head ? head->attempt + 1 : 1;
  }

  TaskEnd operator()() const {
    try {
      require_as_planned(plan_, task_);
      require_room(run_.path(), plan_.min_free_mb);
      const ScratchFolder scratch(scratch_of(run_, plan_, task_.index));
      require_room(scratch.path(), plan_.min_free_mb);
      const pid_t child = ::fork();
      if (child < 0) throw std::runtime_error(std::string("no process for it: ") + std::strerror(errno));
      if (child == 0) child_life(run_, plan_, task_, scratch.path(), number_);
      const Waited waited = wait_for(child, plan_.time_limit_s);
      if (waited.interrupted) return TaskEnd::kInterrupted;
      if (!waited.timed_out && WIFEXITED(waited.status) && WEXITSTATUS(waited.status) == 0) return TaskEnd::kOk;
      return failed(reason_of(waited, plan_, scratch.path()));
    } catch (const std::exception& e) {
      return failed(e.what());
    }
  }

 private:
  [[nodiscard]] TaskEnd failed(const std::string& reason) const {
    const double wall_s = std::chrono::duration<double>(Clock::now() - begin_).count();
    return write_failure(run_, task_, reason, wall_s, number_) ? TaskEnd::kFailed : TaskEnd::kNoResult;
  }

  const RunFolder& run_;
  const FleetPlan& plan_;
  const FleetTask& task_;
  Clock::time_point begin_;
  int number_ = 1;
};

}  // namespace

void block_task_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int signal : {SIGCHLD, SIGINT, SIGTERM}) sigaddset(&signals, signal);
  ::sigprocmask(SIG_BLOCK, &signals, nullptr);
}

TaskEnd run_task(const RunFolder& run, const FleetPlan& plan, std::size_t index) {
  const FleetTask task = run.task(index);
  std::error_code error;
  fs::create_directories(run.task_folder(index), error);
  if (error) {
    std::cerr << fmt::format("task {}: {}: {}\n", index, run.task_folder(index).string(), error.message());
    return TaskEnd::kNoResult;
  }
  const TaskLock lock(lock_path(run, index));
  if (!lock.held()) return TaskEnd::kElsewhere;
  try {
    if (is_done(run, plan, task)) return TaskEnd::kStood;
  } catch (const std::exception&) {
    // The attempt meets it again and says it in a result.
  }
  lock.sign();
  const TaskEnd end = Attempt(run, plan, task)();
  if (end == TaskEnd::kInterrupted) lock.unsign();
  return end;
}

const char* to_words(TaskEnd end) {
  switch (end) {
    case TaskEnd::kOk:
      return "done";
    case TaskEnd::kFailed:
      return "failed";
    case TaskEnd::kStood:
      return "done before";
    case TaskEnd::kElsewhere:
      return "another process is at it";
    case TaskEnd::kInterrupted:
      return "interrupted";
    case TaskEnd::kNoResult:
      return "failed, without a result";
  }
  return "";
}

TaskBegun begun(const RunFolder& run, std::size_t index) {
  const fs::path path = lock_path(run, index);
  return {TaskLock::is_taken(path), TaskLock::signature(path)};
}

}  // namespace roadfix
