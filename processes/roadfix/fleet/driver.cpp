#include "roadfix/fleet/driver.h"

#include <fmt/format.h>
#include <signal.h>

#include <algorithm>
#include <csignal>
#include <iostream>
#include <set>
#include <thread>

#include "bus/run/process_facts.h"
#include "config/config_error.h"
#include "roadfix/console.h"
#include "roadfix/evaluate/evaluate_log.h"
#include "roadfix/fleet/drive_words.h"
#include "roadfix/fleet/task_inputs.h"
#include "roadfix/fleet/task_lock.h"
#include "roadfix/stages.h"

namespace roadfix {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr auto kStep = std::chrono::milliseconds(20);
constexpr std::size_t kNamedFailures = 10;

volatile std::sig_atomic_t stop_asked = 0;

/// Below the root as it was given; elsewhere absolute, so that every worker finds it.
std::string found_path(const std::string& path, const fs::path& root) {
  if (fs::path(path).is_absolute()) return fs::path(path).lexically_normal().string();
  if (fs::exists(root / path)) return path;
  return fs::absolute(path).lexically_normal().string();
}

std::vector<FleetTask> tasks_of(const std::vector<std::vector<std::string>>& drives,
                                const std::vector<FleetConfig>& configs) {
  std::vector<FleetTask> tasks;
  for (std::size_t config = 0; config < configs.size(); ++config) {
    for (const std::vector<std::string>& words : drives) {
      std::string name = fmt::format("{}", fmt::join(words, " "));
      if (configs.size() > 1) name += " @ " + configs[config].path;
      tasks.push_back({tasks.size(), name, words, config});
    }
  }
  return tasks;
}

/// One batch a line, under a number of its own.
fs::path write_batches(const RunFolder& run, std::vector<std::size_t> indices, const EngineOptions& options,
                       std::size_t& lines) {
  if (options.reversed) std::reverse(indices.begin(), indices.end());
  std::string text;
  lines = 0;
  for (std::size_t i = 0; i < indices.size(); ++i) {
    const bool last = (i + 1) % options.batch == 0 || i + 1 == indices.size();
    text += fmt::format("{}{}", indices[i], last ? "\n" : " ");
    lines += last ? 1 : 0;
  }
  const fs::path folder = run.path() / "jobs";
  int number = 1;
  while (fs::exists(folder / fmt::format("{:04}.list", number))) ++number;
  const fs::path path = folder / fmt::format("{:04}.list", number);
  write_text_file(path, text);
  return path;
}

/// How often results are looked for: at every step while they are few, seldom where a look itself is work.
std::chrono::milliseconds look_every(std::size_t tasks) {
  return tasks < 1000 ? std::chrono::milliseconds(200) : std::chrono::milliseconds(5000);
}

/// Until the engine has nothing left. What the user's interruption or a full disk stopped is reported by the caller.
void watch(Engine& engine, FleetProgress& progress, std::size_t tasks, bool shown) {
  ProgressLine line("fleet", shown);
  Clock::time_point next_look;
  bool stopped = false;
  while (engine.step()) {
    if (Clock::now() >= next_look) {
      progress.look();
      next_look = Clock::now() + look_every(tasks);
      line.show(progress.share(), progress.line());
    }
    if (!stopped && (stop_asked != 0 || progress.disk_full())) {
      engine.stop();
      stopped = true;
    }
    std::this_thread::sleep_for(kStep);
  }
  progress.look();
  line.show(progress.share(), progress.line());
}

}  // namespace

void plan_fleet(FleetRequest request, const RunFolder& run) {
  FleetPlan& plan = request.plan;
  plan.build = build_id();
  plan.root = fs::absolute(plan.root.empty() ? fs::path(".") : plan.root).lexically_normal();
  const std::vector<std::string> known = stage_names();
  for (const std::string& stage : plan.stages) {
    if (std::find(known.begin(), known.end(), stage) == known.end())
      throw std::runtime_error(
          fmt::format("--stages: there is no stage '{}' (there are {})", stage, fmt::join(known, ", ")));
  }
  for (const auto& [channel, name] : plan.alignments) static_cast<void>(alignment_named(name));
  if (request.configs.empty()) request.configs.emplace_back();
  std::set<std::string> seen;
  for (const std::string& path : request.configs) {
    FleetConfig config{path.empty() ? path : found_path(path, plan.root), ""};
    if (!seen.insert(config.path).second) throw std::runtime_error(path + ": named twice as a configuration");
    config.digest = config_digest(config, plan.root);
    plan.configs.push_back(std::move(config));
  }
  const std::vector<FleetTask> tasks = tasks_of(expand_drive_words(request.drives, plan.root), plan.configs);
  plan.tasks = tasks.size();
  run.create(plan, tasks);
}

FleetPlan renewed_plan(const RunFolder& run) {
  FleetPlan plan = run.plan();
  bool same = plan.build == build_id();
  plan.build = build_id();
  for (FleetConfig& config : plan.configs) {
    const std::string now = config_digest(config, root_here(plan));
    same = same && now == config.digest;
    config.digest = now;
  }
  if (!same) run.write_plan(plan);
  return plan;
}

int run_fleet(const RunFolder& run, const FleetPlan& plan, const std::vector<std::size_t>& indices,
              const EngineOptions& options) {
  const TaskLock lock(run.path() / "lock");
  if (!lock.held()) {
    throw std::runtime_error(fmt::format("{}: another roadfix fleet is at it: {}", run.path().string(),
                                         TaskLock::signature(run.path() / "lock")));
  }
  lock.sign();
  EngineWork work;
  work.program = fs::read_symlink("/proc/self/exe");
  work.run = run.path();
  work.batches = write_batches(run, indices, options, work.count);
  work.threads = plan.threads;
  work.time_limit_s = plan.time_limit_s;
  work.say = [](const std::string& line) { say("fleet", line); };
  for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, [](int) { stop_asked = 1; });
  FleetProgress progress(run, indices);
  const std::unique_ptr<Engine> engine = make_engine(options, work);
  engine->start();
  if (engine->detached()) {
    std::cout << fmt::format("{}: {} tasks handed over; `roadfix fleet status {}` tells how far they are\n",
                             run.path().string(), indices.size(), run.path().string());
    return 0;
  }
  watch(*engine, progress, indices.size(), options.progress);
  const std::vector<TaskStatus> tasks = survey(run, plan);
  std::cout << status_text(run, tasks, kNamedFailures);
  if (count(tasks, TaskState::kOk) == tasks.size()) return 0;
  if (progress.disk_full()) say("fleet", "stopped: the disk is full; nothing that was done is lost");
  say("fleet", fmt::format("`roadfix fleet resume {}` runs what is missing or failed", run.path().string()));
  return stop_asked != 0 ? kFleetInterrupted : kFleetFailed;
}

std::string status_text(const RunFolder& run, const std::vector<TaskStatus>& tasks, std::size_t failures) {
  std::string text =
      fmt::format("{}: {} tasks: {} done, {} failed, {} missing", run.path().string(), tasks.size(),
                  count(tasks, TaskState::kOk), count(tasks, TaskState::kFailed), count(tasks, TaskState::kMissing));
  if (const std::size_t stale = count(tasks, TaskState::kStale); stale > 0)
    text += fmt::format(", {} of something else", stale);
  text += "\n";
  std::size_t named = 0;
  for (const TaskState state : {TaskState::kFailed, TaskState::kStale, TaskState::kMissing}) {
    for (const TaskStatus& t : tasks) {
      if (t.state != state || named == failures) continue;
      ++named;
      text += fmt::format("  {} {} ({}): {}\n", t.state == TaskState::kFailed ? "failed " : "missing", t.task.index,
                          t.task.name, t.why);
    }
  }
  const std::size_t well = count(tasks, TaskState::kOk);
  if (named < tasks.size() - well) text += fmt::format("  and {} more\n", tasks.size() - well - named);
  return text;
}

}  // namespace roadfix
