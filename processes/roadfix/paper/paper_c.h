/// The experiment of Lee et al. (2025), their tables 1 and 2, over any drive: the fusion as printed, with one of its
/// parts left out at a time, and Roadfix's default.
#pragma once

#include "roadfix/paper/drive.h"
#include "roadfix/paper/report.h"

namespace roadfix {

/// Throws PaperError for a drive without what this needs, and what a replay and an evaluation throw.
PaperReport paper_c(const PaperRequest& request);

}  // namespace roadfix
