/// Plans a run, hands its tasks to an engine and watches it.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "roadfix/fleet/engine.h"
#include "roadfix/fleet/progress.h"
#include "roadfix/fleet/run_folder.h"

namespace roadfix {

/// Exit statuses of `roadfix fleet`.
inline constexpr int kFleetFailed = 1;  ///< a task has failed or has no result
inline constexpr int kFleetInterrupted = 130;

/// What a run was asked for on the command line.
struct FleetRequest {
  std::vector<std::string> drives;   ///< drive_words.h
  std::vector<std::string> configs;  ///< folders; none: defaults and each drive's own calibration
  FleetPlan plan;                    ///< its stages, limits and options
};

/// A new RUN: its plan and its list of tasks. Throws for what cannot be done before anything is begun.
void plan_fleet(FleetRequest request, const RunFolder& run);

/// The plan with the configurations and the program as they are now, written where that differs.
FleetPlan renewed_plan(const RunFolder& run);

/// Runs these tasks and prints how it went; returns the exit status. Detached engines: kOk as soon as they have it.
int run_fleet(const RunFolder& run, const FleetPlan& plan, const std::vector<std::size_t>& indices,
              const EngineOptions& options);

/// A table of the run's state. At most `failures` tasks that are not well are named, with the reason.
std::string status_text(const RunFolder& run, const std::vector<TaskStatus>& tasks, std::size_t failures);

}  // namespace roadfix
