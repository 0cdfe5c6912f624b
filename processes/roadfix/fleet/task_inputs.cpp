#include "roadfix/fleet/task_inputs.h"

#include <fmt/format.h>

#include "bus/log/log_survey.h"
#include "bus/types/message.h"
#include "bus/types/schema.h"
#include "config/config_error.h"
#include "roadfix/config_t.hpp"
#include "roadfix/fleet/input_digest.h"
#include "roadfix/import/source.h"
#include "roadfix/simulate/scenario_file.h"
#include "roadfix/simulate/simulated_log.h"
#include "stream/thread_pool.h"

namespace roadfix {
namespace {

namespace fs = std::filesystem;

std::string scenario_digest(const FleetDrive& drive) {
  std::vector<std::string> remarks;
  return text_digest(
      fmt::format("{}\nseed {}\n", scenario_text(configured_scenario(drive.scenario, remarks)), drive.seed));
}

void copy_tuning(const fs::path& from, const fs::path& to) {
  for (const fs::directory_entry& entry : fs::directory_iterator(from)) {
    if (entry.is_regular_file()) fs::copy_file(entry.path(), to / entry.path().filename());
  }
}

/// The calibration that a log carries in CONFIG_DRIVE.
std::string carried_calibration(const fs::path& log) {
  LogReader reader(log);
  require_our_log(reader);
  const MessageCheck check = Schema::built_in().check_of("config_t");
  while (const auto event = reader.next()) {
    if (event->channel != "CONFIG_DRIVE" || check(event->data) != CheckResult::kOk) continue;
    if (const auto config = decode<config_t>(event->data); !config.calibration_yaml.empty())
      return config.calibration_yaml;
  }
  throw ConfigError(log.string(), 0, "carries no calibration (CONFIG_DRIVE): --config must name a folder that has one");
}

/// Makes logs of recordings and scenarios, and notes the calibration that belongs to them.
class DriveMaker {
 public:
  DriveMaker(const FleetPlan& plan, const FleetDrive& drive, const fs::path& scratch)
      : plan_(plan), drive_(drive), scratch_(scratch) {}

  fs::path log() {
    if (drive_.kind == DriveKind::kLog) return plan_.stage_in ? staged() : drive_.path;
    const fs::path log = scratch_ / "drive.lcm";
    if (drive_.kind == DriveKind::kRecording) {
      SourceOptions options;
      options.format = detect_format(drive_.path);
      Drive read = read_source(drive_.path, options);
      calibration_ = calibration_text(read.description.calibration);
      write_drive_log(std::move(read), drive_.changes, log, {});
      return log;
    }
    std::vector<std::string> remarks;
    const SimulatedDrive made = simulate(configured_scenario(drive_.scenario, remarks), drive_.seed);
    calibration_ = calibration_text(calibration_of(made));
    ThreadPool threads(plan_.threads);
    write_simulated_log(made, log, {.executor = threads, .to_disk = false});
    return log;
  }

  [[nodiscard]] std::string calibration(const fs::path& log) const {
    return calibration_.empty() ? carried_calibration(log) : calibration_;
  }

 private:
  [[nodiscard]] fs::path staged() const {
    const fs::path copy = scratch_ / "staged.lcm";
    std::error_code error;
    fs::copy_file(drive_.path, copy, error);
    if (error)
      throw ConfigError(drive_.path.string(), 0,
                        fmt::format("cannot be staged in to {}: {}", copy.string(), error.message()));
    return copy;
  }

  const FleetPlan& plan_;
  const FleetDrive& drive_;
  fs::path scratch_;
  std::string calibration_;
};

}  // namespace

std::string input_digest(const FleetDrive& drive) {
  return drive.kind == DriveKind::kScenario ? scenario_digest(drive) : path_digest(drive.path);
}

std::string input_stamp(const FleetDrive& drive) {
  return drive.kind == DriveKind::kScenario ? scenario_digest(drive) : path_stamp(drive.path);
}

std::string config_digest(const FleetConfig& config, const fs::path& root) {
  if (config.path.empty()) return "";
  const fs::path folder = root / config.path;
  if (!fs::is_directory(folder)) throw ConfigError(folder.string(), 0, "is no folder of a vehicle's configuration");
  return path_digest(folder);
}

TaskInputs make_inputs(const FleetPlan& plan, const FleetTask& task, const FleetDrive& drive, const fs::path& scratch) {
  const FleetConfig& config = plan.configs.at(task.config);
  const fs::path folder = config.path.empty() ? fs::path() : root_here(plan) / config.path;
  DriveMaker maker(plan, drive, scratch);
  TaskInputs inputs{maker.log(), folder};
  if (!folder.empty() && fs::exists(folder / "calibration.yaml")) return inputs;
  inputs.vehicle = scratch / "vehicle";
  fs::create_directories(inputs.vehicle);
  if (!folder.empty()) copy_tuning(folder, inputs.vehicle);
  write_text_file(inputs.vehicle / "calibration.yaml", maker.calibration(inputs.log));
  return inputs;
}

}  // namespace roadfix
