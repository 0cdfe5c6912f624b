/// Position errors without what changes slowly: what Lee et al. (2025) did to their visual-inertial trajectory, by the reference, before they scored
/// it. Nothing that a car could do; never to be compared with figures of poses as published. MODEL.md (E.4.4).
#pragma once

#include <optional>
#include <vector>

#include "evaluation/errors.h"

namespace roadfix {

/// m, axes of the frame: each error less the mean of those within half of `window_s` of it. The errors are in order of time.
std::vector<Eigen::Vector3d> without_slow_part(const std::vector<PoseError>& errors, double window_s);

struct SlowlessFigures {
  double window_s = 0.0;
  double ate_mean = 0.0;           ///< m, Lee et al. (2025), (9)
  double ate_rmse = 0.0;           ///< m
  std::optional<double> rpe_mean;  ///< m, their (10)
};
/// Nothing without errors.
std::optional<SlowlessFigures> slowless_figures(const std::vector<PoseError>& errors, double window_s,
                                                int stride = 100);

}  // namespace roadfix
