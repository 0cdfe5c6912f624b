/// What a task computes from, found or made on the worker: the drive as a log, and the vehicle folder.
#pragma once

#include <filesystem>
#include <string>

#include "roadfix/fleet/drive_words.h"
#include "roadfix/fleet/run_folder.h"

namespace roadfix {

struct TaskInputs {
  std::filesystem::path log;
  std::filesystem::path vehicle;
};

/// Digest of the drive: of its files' bytes, or of everything that a scenario and its seed say.
std::string input_digest(const FleetDrive& drive);
/// As input_digest() for a scenario; of sizes and times for files.
std::string input_stamp(const FleetDrive& drive);
/// Empty for a configuration that is not there: the defaults.
std::string config_digest(const FleetConfig& config, const std::filesystem::path& root);

/// The log: the drive's own, its copy where it is staged in, or one made of a recording or scenario. The vehicle: the
/// configuration's folder, or a copy with the drive's own calibration. What is made lies in `scratch`.
TaskInputs make_inputs(const FleetPlan& plan, const FleetTask& task, const FleetDrive& drive,
                       const std::filesystem::path& scratch);

}  // namespace roadfix
