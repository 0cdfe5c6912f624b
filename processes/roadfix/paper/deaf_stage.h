/// A stage that does not hear one of its inputs, as if nobody published it; all else is as it was. For estimators that are to be independent.
#pragma once

#include <memory>
#include <string>

#include "bus/stage.h"

namespace roadfix {

/// The stage itself where it has no such input.
std::unique_ptr<Stage> deaf_to(const std::string& channel, std::unique_ptr<Stage> stage);

}  // namespace roadfix
