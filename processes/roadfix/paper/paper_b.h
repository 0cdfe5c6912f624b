/// The experiment of Ock et al. (2020) over any drive with a camera and wheels, without GNSS: vision alone, wheels alone, their
/// scheme as printed, and Roadfix's default; figures 8 to 11.
#pragma once

#include "papers/printed_localization.h"
#include "roadfix/paper/drive.h"
#include "roadfix/paper/report.h"

namespace roadfix {

struct PaperBRequest {
  PaperRequest drive;
  PrintedLocalizationConfig scheme;
  double least_turn = 0.0;  ///< rad, of the turns in figure 8
};

/// Throws PaperError for a drive without what this needs, and what a replay and an evaluation throw.
PaperReport paper_b(const PaperBRequest& request);

}  // namespace roadfix
