// roadfix fleet: many drives with one command, on this machine or a cluster.
#include <fmt/format.h>
#include <glob.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>

#include "config/config_error.h"
#include "roadfix/commands.h"
#include "roadfix/common_options.h"
#include "roadfix/evaluate/evaluate_log.h"
#include "roadfix/fleet/compare.h"
#include "roadfix/fleet/driver.h"
#include "roadfix/fleet/report.h"
#include "roadfix/fleet/run_task.h"

namespace roadfix {
namespace {

constexpr const char* kStatuses =
    "Exit status: 0 done; 1 a task has failed or has no result; 2 not done, standard error says why; 130 interrupted.";

struct FleetRunOptions {
  FleetRequest request;
  OutputOption out;  ///< RUN
  std::string config;
  std::string configs;
  std::vector<std::string> aligned;  ///< CHANNEL=ALIGNMENT
  EngineOptions engine;
};

struct FolderOptions {
  std::filesystem::path run;
  EngineOptions engine;
  std::size_t failures = 20;
  std::vector<std::size_t> indices;
};

struct CompareArguments {
  std::filesystem::path run_a;
  std::filesystem::path run_b;
  CompareOptions options;
};

std::vector<std::string> folders_matching(const std::string& pattern) {
  glob_t found{};
  const int status = ::glob(pattern.c_str(), GLOB_ONLYDIR, nullptr, &found);
  std::vector<std::string> folders(found.gl_pathv, found.gl_pathv + found.gl_pathc);
  ::globfree(&found);
  std::erase_if(folders, [](const std::string& path) { return !std::filesystem::is_directory(path); });
  if (status != 0 || folders.empty()) throw std::runtime_error("--configs " + pattern + ": no folder matches");
  return folders;
}

void read_alignments(const FleetRunOptions& options, FleetPlan& plan) {
  for (const std::string& word : options.aligned) {
    const std::size_t equals = word.find('=');
    if (equals == std::string::npos) throw std::runtime_error("--align " + word + ": must be CHANNEL=ALIGNMENT");
    plan.alignments[word.substr(0, equals)] = word.substr(equals + 1);
  }
}

void finish(int status) {
  if (status != 0) throw CLI::RuntimeError(status);
}

void run_fleet(FleetRunOptions& options) {
  FleetRequest& request = options.request;
  if (!options.config.empty() && !options.configs.empty())
    throw std::runtime_error("--config and --configs: one of them");
  if (!options.config.empty()) request.configs = {options.config};
  if (!options.configs.empty()) request.configs = folders_matching(options.configs);
  read_alignments(options, request.plan);
  const RunFolder folder(options.out.path);
  if (options.out.overwrite && folder.exists()) std::filesystem::remove_all(folder.path());
  plan_fleet(request, folder);
  const FleetPlan plan = folder.plan();
  std::vector<std::size_t> all(plan.tasks);
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = i;
  finish(run_fleet(folder, plan, all, options.engine));
}

void resume(const FolderOptions& options) {
  const RunFolder folder(options.run);
  if (const std::vector<std::string> jobs = unfinished_slurm_jobs(folder.path()); !jobs.empty()) {
    throw std::runtime_error(fmt::format("{}: Slurm has not ended job {} yet: wait, or scancel it first",
                                         folder.path().string(), fmt::join(jobs, ", ")));
  }
  const FleetPlan plan = renewed_plan(folder);
  const std::vector<TaskStatus> tasks = survey(folder, plan);
  std::vector<std::size_t> left;
  for (const TaskStatus& t : tasks) {
    if (t.state != TaskState::kOk) left.push_back(t.task.index);
  }
  std::cout << status_text(folder, tasks, options.failures);
  if (left.empty()) return;
  finish(run_fleet(folder, plan, left, options.engine));
}

void status(const FolderOptions& options) {
  const RunFolder folder(options.run);
  const std::vector<TaskStatus> tasks = survey(folder, folder.plan());
  std::cout << status_text(folder, tasks, options.failures);
  if (const std::optional<double> left_s = time_left(folder, tasks); left_s)
    std::cout << "about " << duration_text(*left_s) << " left\n";
  if (const std::vector<std::string> jobs = unfinished_slurm_jobs(folder.path()); !jobs.empty())
    std::cout << fmt::format("Slurm has still to end job {}\n", fmt::join(jobs, ", "));
  finish(count(tasks, TaskState::kOk) == tasks.size() ? 0 : kFleetFailed);
}

void report(const FolderOptions& options) {
  const RunFolder folder(options.run);
  const FleetPlan plan = folder.plan();
  const FleetSummary summary = summarise_run(folder);
  const std::filesystem::path page = folder.path() / "report.html";
  write_text_file(page, fleet_page(folder, plan, summary));
  std::cout << fleet_table(folder, summary) << page.string() << "\n";
}

void compare(const CompareArguments& arguments) {
  const Comparison comparison = compare_runs(RunFolder(arguments.run_a), RunFolder(arguments.run_b), arguments.options);
  std::cout << comparison_text(comparison, arguments.options);
  finish(comparison.regressed() ? kNotGood : 0);
}

/// What an engine starts.
void do_tasks(const FolderOptions& options) {
  const RunFolder folder(options.run);
  const FleetPlan plan = folder.plan();
  block_task_signals();
  bool all_well = true;
  for (const std::size_t index : options.indices) {
    const TaskEnd end = run_task(folder, plan, index);
    if (end != TaskEnd::kOk && end != TaskEnd::kStood) {
      std::cerr << fmt::format("task {}: {}\n", index, to_words(end));
      all_well = false;
    }
    if (end == TaskEnd::kInterrupted) finish(kFleetInterrupted);
  }
  finish(all_well ? 0 : kFleetFailed);
}

void add_engine_options(CLI::App& command, EngineOptions& engine) {
  command.add_option("--engine", engine.engine, "slurm, parallel, local; auto: the first of them that is there")
      ->check(CLI::IsMember(engine_names()))
      ->envname("ROADFIX_FLEET_ENGINE")
      ->capture_default_str();
  command.add_option("--jobs", engine.jobs, "at a time (default: one a core; of Slurm: no limit)")
      ->check(CLI::Range(1, 100000));
  command.add_option("--batch", engine.batch, "tasks one after the other in one job")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  command.add_flag("--reversed", engine.reversed, "the last task first");
  add_progress(command, engine.progress);
  command.add_flag("--wait", engine.wait, "Slurm: stay until all have ended; the other engines always do");
  command.add_option("--partition", engine.partition, "Slurm's");
  command.add_option("--account", engine.account, "Slurm's");
  command.add_option("--memory-mb", engine.memory_mb, "Slurm: of one job")->check(CLI::Range(1.0, 1e7));
  command.add_option("--sbatch-option", engine.sbatch_options, "passed on to sbatch as it is; may be given again")
      ->allow_extra_args(false);
}

void add_task_options(CLI::App& command, FleetRunOptions& options) {
  FleetPlan& plan = options.request.plan;
  add_stages(command, plan.stages, "Stages, separated by commas")->required();
  command.add_option("--config", options.config,
                     "The vehicle's configuration folder; without a calibration.yaml in it each drive's own is used");
  command.add_option("--configs", options.configs, "pattern of such folders: every drive with each of them");
  add_channels(command, plan.channels, "What to score; every POSE_* channel where none is named");
  command.add_option("--align", options.aligned, "CHANNEL=ALIGNMENT, as `roadfix evaluate --align`");
  command.add_flag("--fit-latency", plan.fit_delay, "as `roadfix evaluate --fit-latency`");
  plan.keep = {"report"};
  command.add_option("--keep", plan.keep, "of each drive: report, errors (CSV), outputs (log), drive (log), or none")
      ->delimiter(',')
      ->check(CLI::IsMember({"report", "errors", "outputs", "drive", "none"}))
      ->capture_default_str();
  command.add_option("--root", plan.root, "where relative paths begin (on workers: ROADFIX_FLEET_ROOT, if set)")
      ->envname("ROADFIX_FLEET_ROOT");
  command.add_flag("--stage-in", plan.stage_in, "copy each log to the worker's scratch folder first");
  command.add_option("--scratch", plan.scratch, "folder for what is in between (default: the worker's TMPDIR)");
  command.add_option("--time-limit-s", plan.time_limit_s, "of one task; then it is killed")
      ->check(CLI::Range(0.1, 1e6))
      ->capture_default_str();
  command.add_option("--min-free-mb", plan.min_free_mb, "room on the disks for a task to begin")
      ->check(CLI::Range(0, 100000000))
      ->capture_default_str();
  command.add_option("--threads", plan.threads, "of one task, to draw pictures")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
}

CLI::App* add_folder_command(CLI::App& fleet, const std::string& name, const std::string& what,
                             FolderOptions& options) {
  CLI::App* command = fleet.add_subcommand(name, what);
  command->add_option("run", options.run, "what `roadfix fleet run --out` made")->required();
  return command;
}

void add_compare_command(CLI::App& fleet) {
  const auto arguments = std::make_shared<CompareArguments>();
  CompareOptions& options = arguments->options;
  CLI::App* command = fleet.add_subcommand("compare", "Two runs over the same drives: what got worse from A to B?");
  command->add_option("run_a", arguments->run_a, "the run before")->required();
  command->add_option("run_b", arguments->run_b, "the run after")->required();
  add_channels(*command, options.channels, "What to compare; every channel of A where none is named");
  command->add_option("--tolerance", options.tolerance, "share by which a figure of one drive may get worse")
      ->check(CLI::Range(0.0, 1e6))
      ->capture_default_str();
  command->add_option("--mean-tolerance", options.mean_tolerance, "and the mean over all drives, where that is certain")
      ->check(CLI::Range(0.0, 1e6))
      ->capture_default_str();
  command->add_option("--confidence", options.confidence, "of all intervals together")
      ->check(CLI::Range(0.5, 0.999999))
      ->capture_default_str();
  command->add_option("--worst", options.worst, "so many drives are named")->capture_default_str();
  command->footer("Exit status: 0 no regression; 1 a regression; 2 not done, standard error says why.");
  command->callback([arguments] { compare(*arguments); });
}

}  // namespace

void add_fleet_command(CLI::App& app) {
  CLI::App* fleet = app.add_subcommand("fleet", "Many drives: replay and score them all, compare two builds, resume");
  fleet->require_subcommand(1);
  const auto run_options = std::make_shared<FleetRunOptions>();
  CLI::App* start = fleet->add_subcommand("run", "Replay and score drives, each a task of its own");
  start
      ->add_option("drives", run_options->request.drives,
                   "logs, recordings, scenarios with seeds=1..200 fault=NAME@START, or @FILE of such words")
      ->required();
  add_output(*start, run_options->out, "The run's folder, to be made; workers must reach it by this path");
  start->footer(kStatuses);
  add_task_options(*start, *run_options);
  add_engine_options(*start, run_options->engine);
  start->callback([run_options] { run_fleet(*run_options); });

  const auto folder_options = std::make_shared<FolderOptions>();
  CLI::App* shown = add_folder_command(*fleet, "status", "How far a run is, what failed and why", *folder_options);
  shown->add_option("--failures", folder_options->failures, "so many are named")->capture_default_str();
  shown->footer(kStatuses);
  shown->callback([folder_options] { status(*folder_options); });
  CLI::App* again = add_folder_command(
      *fleet, "resume", "Run what is missing, failed or of another build, configuration or input", *folder_options);
  add_engine_options(*again, folder_options->engine);
  again->footer(kStatuses);
  again->callback([folder_options] { resume(*folder_options); });
  CLI::App* shown_page = add_folder_command(
      *fleet, "report", "RUN/report.html, RUN/results.jsonl and a table of all drives", *folder_options);
  shown_page->callback([folder_options] { report(*folder_options); });
  add_compare_command(*fleet);
  CLI::App* task = add_folder_command(*fleet, "task", "Run tasks of a run by their index", *folder_options);
  task->group("");  // for engines, not for people
  task->add_option("indices", folder_options->indices, "from 0")->required();
  task->callback([folder_options] { do_tasks(*folder_options); });
}

}  // namespace roadfix
