/// RUN, the folder that a fleet's plan and results live in. Everything that workers on other machines need is in it:
///
///   fleet.json               the plan: stages, configurations, what to keep, limits, digests
///   tasks.jsonl              one task a line: the words that name its drive, and its configuration
///   tasks/000012/result.json figures, digests and cost of task 12, written whole or not at all
///   tasks/000012/report/     its report, its errors, its logs, as far as they are to be kept
///   jobs/                    what was handed to the engine
///   results.jsonl report.html    by `roadfix fleet report`
#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

namespace roadfix {

/// One vehicle folder. Without a calibration.yaml each drive's own is used: simulated, imported, or carried in the log.
struct FleetConfig {
  std::string path;    ///< below the root or absolute; empty: defaults
  std::string digest;  ///< of its files
};

struct FleetPlan {
  std::string build;
  std::vector<std::string> stages;
  std::vector<FleetConfig> configs;
  std::vector<std::string> channels;              ///< to score; all where empty
  std::map<std::string, std::string> alignments;  ///< by channel
  bool fit_delay = false;
  std::vector<std::string> keep;  ///< of each drive: report, errors, outputs, drive
  std::filesystem::path root;     ///< what relative paths of drives and configurations begin at
  std::filesystem::path scratch;  ///< of a worker; empty: its TMPDIR
  bool stage_in = false;
  double time_limit_s = 3600.0;  ///< of one task
  int64_t min_free_mb = 200;     ///< on the disks of RUN and scratch, for a task to begin
  int threads = 1;               ///< of one task
  std::size_t tasks = 0;
};

struct FleetTask {
  std::size_t index = 0;
  std::string name;                ///< the same drive with the same configuration in another run has the same name
  std::vector<std::string> words;  ///< drive_words.h
  std::size_t config = 0;          ///< index into the plan's
};

/// What a result is a result of: it stands as long as all four are the same.
struct TaskKey {
  std::string input;    ///< digest of the drive's bytes, or of the scenario and seed
  std::string config;   ///< digest of the vehicle folder
  std::string build;    ///< of the program
  std::string request;  ///< digest of stages, changes to the drive, what to score and keep
  bool operator==(const TaskKey&) const = default;
};

/// A result.json up to its figures: enough to know what is done.
struct ResultHead {
  bool ok = false;
  std::string reason;  ///< of a failure
  TaskKey key;
  std::string input_stamp;  ///< sizes and times of the drive's files when it was read
  double wall_s = 0.0;
  double cpu_s = 0.0;
  int attempt = 0;
};

class RunFolder {
 public:
  explicit RunFolder(std::filesystem::path path) : path_(std::filesystem::absolute(std::move(path))) {}

  /// Throws std::runtime_error where there is a plan already or it cannot be written.
  void create(const FleetPlan& plan, const std::vector<FleetTask>& tasks) const;
  [[nodiscard]] bool exists() const;
  void write_plan(const FleetPlan& plan) const;

  /// ConfigError, naming the file, where it is none of a fleet's.
  [[nodiscard]] FleetPlan plan() const;
  [[nodiscard]] std::vector<FleetTask> tasks() const;
  [[nodiscard]] FleetTask task(std::size_t index) const;

  /// Nothing where the task has no result, or a file that is none.
  [[nodiscard]] std::optional<ResultHead> head(std::size_t index) const;
  [[nodiscard]] nlohmann::ordered_json result(std::size_t index) const;
  void write_result(std::size_t index, const nlohmann::ordered_json& result) const;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] std::filesystem::path task_folder(std::size_t index) const;
  [[nodiscard]] std::filesystem::path result_path(std::size_t index) const {
    return task_folder(index) / "result.json";
  }

 private:
  std::filesystem::path path_;
};

/// Where a relative path of the plan is on this machine: below ROADFIX_FLEET_ROOT where that is set, else below the
/// plan's root.
std::filesystem::path root_here(const FleetPlan& plan);

/// Digest of what the plan and the task's words ask for, beside input, configuration and build.
std::string request_digest(const FleetPlan& plan, const FleetTask& task);

}  // namespace roadfix
