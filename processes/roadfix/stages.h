/// The stages that this program knows, in the order of their data: an earlier one's outputs are inputs of a later one.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "bus/stage.h"

namespace roadfix {

std::vector<std::string> stage_names();

/// Whether a vehicle with this folder has what the stage is for: without a camera nobody wants the visual one, and
/// its absence need not be reported. A calibration that cannot be read is reported elsewhere.
bool is_for_vehicle(const std::string& stage, const std::filesystem::path& vehicle_dir);

/// Each with the configuration that `vehicle_dir` holds for it. In the order of stage_names(), whatever the order asked
/// for. Throws std::runtime_error for an unknown or repeated name, and what the configuration's reader throws.
std::vector<std::unique_ptr<Stage>> make_stages(const std::vector<std::string>& names,
                                                const std::filesystem::path& vehicle_dir);

}  // namespace roadfix
