/// A scenario and what was asked to be different about it, on a command line or in a fleet's list of drives.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "simulation/scenario_config.h"

namespace roadfix {

struct ScenarioRequest {
  std::string scenario;                ///< name or YAML file
  double duration_s = 0.0;             ///< 0: the scenario's own
  std::optional<CameraLayout> camera;  ///< none: the scenario's own
  double camera_rate_hz = 0.0;         ///< 0: the scenario's own
  std::string picture_size;            ///< WIDTHxHEIGHT, px; empty: the scenario's own
  bool lossless = false;
  std::vector<std::string> faults;  ///< as parse_fault() takes them, beside the scenario's own
};

/// Adds a remark for each fault that never acts. Throws, naming what is wrong, for a scenario, a size or a fault that
/// is none.
ScenarioConfig configured_scenario(const ScenarioRequest& request, std::vector<std::string>& remarks);

}  // namespace roadfix
