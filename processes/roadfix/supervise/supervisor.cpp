#include "roadfix/supervise/supervisor.h"

#include <fmt/format.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <thread>
#include <utility>

namespace roadfix {
namespace {

constexpr auto kPoll = std::chrono::milliseconds(10);
/// What a shell says of a command that cannot be run.
constexpr int kCannotRun = 127;

std::chrono::steady_clock::duration seconds(double s) {
  return std::chrono::duration_cast<std::chrono::steady_clock::duration>(std::chrono::duration<double>(s));
}

std::string how_it_ended(int status) {
  if (WIFSIGNALED(status))
    return fmt::format("was killed by signal {} ({})", WTERMSIG(status), strsignal(WTERMSIG(status)));
  const int code = WEXITSTATUS(status);
  if (code == kCannotRun) return "cannot be run: is it built, and its name right?";
  return fmt::format("ended with status {}", code);
}

/// In the child: its own process group, so that Ctrl-C reaches the supervisor alone, which then stops all in order;
/// dies with the supervisor.
[[noreturn]] void become(const std::vector<std::string>& command) {
  setpgid(0, 0);
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  std::vector<char*> arguments;
  arguments.reserve(command.size() + 1);
  for (const std::string& word : command) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  execvp(arguments[0], arguments.data());
  _exit(kCannotRun);
}

}  // namespace

std::vector<std::string> command_line(const SupervisedProcess& process, const std::filesystem::path& vehicle,
                                      const std::string& bus, const std::filesystem::path& programs) {
  const std::string name = process.program.empty() ? process.name : process.program;
  const std::filesystem::path beside = programs / name;
  std::vector<std::string> command = {std::filesystem::exists(beside) ? beside.string() : name};
  if (!process.plain) command.insert(command.end(), {"--config", vehicle.string(), "--bus", bus});
  if (process.realtime_priority > 0) {
    command.insert(command.end(), {"--realtime", std::to_string(process.realtime_priority)});
  }
  command.insert(command.end(), process.arguments.begin(), process.arguments.end());
  return command;
}

Supervisor::Supervisor(const RunConfig& config, const std::filesystem::path& vehicle,
                       const std::filesystem::path& programs, Say say)
    : config_(config), say_(std::move(say)) {
  auto due = Clock::now();
  for (const SupervisedProcess& process : config_.processes) {
    Child child;
    child.name = process.name;
    child.command = command_line(process, vehicle, config_.bus, programs);
    child.due = due;
    due += seconds(config_.start_gap);
    children_.push_back(std::move(child));
  }
}

Supervisor::~Supervisor() {
  for (Child& child : children_)
    if (child.pid > 0) {
      kill(-child.pid, SIGKILL);
      waitpid(child.pid, nullptr, 0);
    }
}

void Supervisor::start(Child& child) {
  const pid_t pid = fork();
  if (pid == 0) become(child.command);
  child.started = Clock::now();
  if (pid < 0) {
    say_(fmt::format("{}: cannot fork: {}", child.name, std::strerror(errno)));
    child.due = child.started + seconds(config_.backoff_max);
    return;
  }
  setpgid(pid, pid);  // here too: the group must exist before anyone signals it
  child.pid = pid;
  say_(fmt::format("{} started, process {}", child.name, pid));
}

void Supervisor::died(Child& child, int status) {
  const auto now = Clock::now();
  kill(-child.pid, SIGKILL);  // what it started itself and left behind
  child.pid = 0;
  child.deaths_in_a_row = now - child.started > seconds(config_.healthy_after) ? 1 : child.deaths_in_a_row + 1;
  double wait = config_.backoff_first;
  for (int i = 1; i < child.deaths_in_a_row && wait < config_.backoff_max; ++i) wait *= 2.0;
  wait = std::min(wait, config_.backoff_max);
  child.due = now + seconds(wait);
  ++restarts_;
  say_(fmt::format("{} {}; starts again in {:.2f} s", child.name, how_it_ended(status), wait));
}

void Supervisor::reap() {
  for (Child& child : children_) {
    int status = 0;
    if (child.pid > 0 && waitpid(child.pid, &status, WNOHANG) == child.pid) died(child, status);
  }
}

void Supervisor::step() {
  reap();
  for (Child& child : children_)
    if (child.pid == 0 && Clock::now() >= child.due) start(child);
}

void Supervisor::stop() {
  for (auto child = children_.rbegin(); child != children_.rend(); ++child) {
    if (child->pid == 0) continue;
    const auto begin = Clock::now();
    const int signals[] = {SIGINT, SIGTERM, SIGKILL};
    int sent = 0;
    int status = 0;
    while (waitpid(child->pid, &status, WNOHANG) == 0) {
      if (sent < 3 && Clock::now() - begin >= sent * seconds(config_.stop_patience)) {
        if (sent > 0) say_(fmt::format("{} does not stop: {}", child->name, strsignal(signals[sent])));
        kill(-child->pid, signals[sent++]);
      }
      std::this_thread::sleep_for(kPoll);
    }
    kill(-child->pid, SIGKILL);  // what it started itself and left behind
    child->pid = 0;
    say_(fmt::format("{} {}", child->name, how_it_ended(status)));
  }
}

int Supervisor::running() const {
  return static_cast<int>(std::count_if(children_.begin(), children_.end(), [](const Child& c) { return c.pid > 0; }));
}

}  // namespace roadfix
