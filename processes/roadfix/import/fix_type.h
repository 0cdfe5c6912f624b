/// fix_type of gnss.csv as words.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "samples/samples.h"

namespace roadfix {

/// none, single, differential, rtk_float, rtk_fixed, dead_reckoning.
const std::vector<std::string>& fix_type_names();
std::optional<FixType> fix_type_from_name(std::string_view name);

}  // namespace roadfix
