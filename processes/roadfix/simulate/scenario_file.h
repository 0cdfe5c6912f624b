/// A scenario as YAML: `scenario` names the one to begin with, every other key (simulation/scenario_config.h) replaces
/// a value of it; a list of faults replaces the scenario's own.
#pragma once

#include <filesystem>
#include <string>

#include "simulation/scenario_config.h"

namespace roadfix {

/// The name of a scenario, or a YAML file; ConfigError or std::invalid_argument where it is neither.
ScenarioConfig load_scenario(const std::string& name_or_file);

bool is_scenario(const std::string& name);

/// All values, as a file that load_scenario() takes.
std::string scenario_text(const ScenarioConfig& config);

}  // namespace roadfix
