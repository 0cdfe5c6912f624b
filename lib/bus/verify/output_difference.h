/// Verify's findings as text.
#pragma once

#include <roadfix/config_t.hpp>
#include <string>
#include <vector>

#include "bus/verify/stage_log.h"

namespace roadfix {

/// What differs first between a recorded output and the one published again (empty: none was), and what is known of the
/// cause. `before` is the last output that was identical, or null.
std::string describe_difference(const StageSpec& spec, const RecordedOutput& recorded,
                                std::span<const uint8_t> replayed, const RecordedOutput* before);

std::string describe_loss(const StageSpec& spec, const LogLoss& loss);

/// What makes two processes compute different bits: build, libraries, CPU, configuration.
std::vector<std::string> config_differences(const config_t& car, const config_t& here);

}  // namespace roadfix
