/// One number for what a process runs with.
#pragma once

#include <cstdint>
#include <string>

namespace roadfix {

/// XXH3 over both texts and their lengths, as config_t carries it.
int64_t config_hash(const std::string& config_yaml, const std::string& calibration_yaml);

}  // namespace roadfix
