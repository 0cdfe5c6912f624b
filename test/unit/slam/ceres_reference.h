/// The same bundle adjustment by Ceres, with automatic derivatives: what ours is compared with. In a file of its own
/// because Ceres brings a CHECK that is not Catch2's.
#pragma once

#include "slam/bundle.h"

namespace roadfix::test {

struct CeresResult {
  double cost = 0.0;
  std::vector<SE3> views;
};

/// Views and points; the lens stays, the right eye is only beside the left one.
CeresResult adjust_with_ceres(const BundleProblem& problem);

}  // namespace roadfix::test
