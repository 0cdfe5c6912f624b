/// The work of one task: a drive found or made, replayed, scored, its outputs digested.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>

#include "roadfix/fleet/run_folder.h"

namespace roadfix {

/// The task's result with status ok. Throws what its parts throw. Everything in between lies in `scratch`; what is to
/// be kept goes to the task's folder.
nlohmann::ordered_json do_task(const RunFolder& run, const FleetPlan& plan, const FleetTask& task, const TaskKey& key,
                               const std::filesystem::path& scratch);

/// The key that the task's result has now; reads the whole input.
TaskKey task_key(const FleetPlan& plan, const FleetTask& task);

/// Whether the task has a result that stands: well ended, of the same input, configuration, build and request. Reads
/// the input only where its stamp is another one.
bool is_done(const RunFolder& run, const FleetPlan& plan, const FleetTask& task);

}  // namespace roadfix
