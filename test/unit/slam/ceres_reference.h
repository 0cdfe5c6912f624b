/// The same bundle adjustment by Ceres with automatic derivatives, as a reference. In a file of its own because Ceres
/// defines a CHECK that conflicts with Catch2's.
#pragma once

#include "slam/bundle.h"

namespace roadfix::test {

struct CeresResult {
  double cost = 0.0;
  std::vector<SE3> views;
};

/// Views and points; the lens is fixed, the right camera is only a baseline away from the left one.
CeresResult adjust_with_ceres(const BundleProblem& problem);

}  // namespace roadfix::test
