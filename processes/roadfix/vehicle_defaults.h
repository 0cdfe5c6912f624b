/// Tuning files for a new vehicle.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace roadfix {

/// For each stage without a DIR/STAGE.yaml writes one with every key at its default, each line a comment: the defaults
/// stay the program's until somebody changes one. A stage that is not for this vehicle gets none. DIR has a
/// calibration.yaml already. Returns one line per stage that this calibration is not enough for, with the reason.
std::vector<std::string> write_process_defaults(const std::filesystem::path& directory);

}  // namespace roadfix
