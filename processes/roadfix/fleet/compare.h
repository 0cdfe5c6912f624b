/// Two runs over the same drives, drive by drive: what got worse, and is it worse on the whole?
#pragma once

#include <string>
#include <vector>

#include "evaluation/paired.h"
#include "roadfix/fleet/run_folder.h"

namespace roadfix {

struct CompareOptions {
  std::vector<std::string> channels;  ///< all that both runs have, where empty
  double tolerance = 0.05;            ///< share by which one drive may get worse
  double mean_tolerance = 0.01;       ///< and all drives together, where the interval has no zero in it
  double confidence = 0.99;           ///< of all intervals together (Bonferroni)
  std::size_t worst = 10;             ///< drives that are named
};

/// One figure of one channel, zero or more and smaller the better, over all drives that have it in both runs.
struct ComparedFigure {
  std::string channel;
  std::string figure;
  double floor = 0.0;               ///< what lies far below it is no change
  std::vector<std::size_t> drives;  ///< indices into Comparison::names
  std::vector<double> a, b;
  PairedTest test;
  std::vector<std::size_t> worse;  ///< indices into `drives` beyond the tolerance, the worst first
  bool worse_on_the_whole = false;
};

struct Comparison {
  std::vector<std::string> names;  ///< of the drives that ended well in both
  std::vector<ComparedFigure> figures;
  std::vector<std::string> lost;       ///< ended well in A and not in B, or lost a channel, with the reason
  std::size_t only_a = 0, only_b = 0;  ///< drives that only one of the runs has
  std::size_t same_digests = 0;        ///< drives whose outputs are the same bits
  [[nodiscard]] bool regressed() const;
};

Comparison compare_runs(const RunFolder& a, const RunFolder& b, const CompareOptions& options);

/// Table of figures, the worst drives, and the verdict.
std::string comparison_text(const Comparison& comparison, const CompareOptions& options);

}  // namespace roadfix
