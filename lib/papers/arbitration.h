/// Ock et al. (2020), section 3.2, as printed: (14) compares camera and wheels, (15) picks the pose (MODEL.md, section 2).
#pragma once

#include <Eigen/Dense>

#include "geometry/euler.h"

namespace roadfix {

/// x, y and the three angles: what Ock et al. (2020) compares.
struct PaperPose {
  Eigen::Vector2d position = Eigen::Vector2d::Zero();  ///< m
  YawPitchRoll angles;
};

/// O_diff, Ock et al. (2020), (14), with the division by three that is printed and has no reason. Zero whenever position alone or
/// attitude alone differs.
double printed_difference(const PaperPose& wheels, const PaperPose& visual);

struct Arbitrated {
  PaperPose pose;
  bool visual_used = true;
};
/// Ock et al. (2020), (15): the mean of both up to the threshold, the wheels beyond it. Angles are averaged on the circle.
Arbitrated printed_arbitration(const PaperPose& wheels, const PaperPose& visual, double threshold);

}  // namespace roadfix
