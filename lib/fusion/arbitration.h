/// Ock et al. (2020), section 3.2: do the camera and the wheels agree? As printed, (14) and (15), and as a normalised test on
/// relative motion with hysteresis (MODEL.md, section 7).
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

struct AgreementConfig {
  double gate = 16.3;   ///< squared Mahalanobis distance of one comparison (3 degrees of freedom) that counts against
  int bad_after = 5;    ///< comparisons beyond the gate in a row: no agreement
  double clear = 7.8;   ///< and below this (95 %) ...
  int good_after = 10;  ///< ... that many times in a row: agreement again
};

template <class Visitor>
void visit(AgreementConfig& c, Visitor& v) {
  v.number("gate", c.gate, 0.1, 1e6);
  v.integer("bad_after", c.bad_after, 1, 10000);
  v.number("clear", c.clear, 0.01, 1e6);
  v.integer("good_after", c.good_after, 1, 10000);
}

/// AgreementState with hysteresis: one outlier does not break it, one lucky comparison does not mend it.
struct AgreementState {
  bool agrees = true;
  int count = 0;  ///< comparisons in a row for a change
};
void compare(AgreementState& a, const AgreementConfig& config, double squared_distance);

/// Mean of two motions weighted by their covariances, and its covariance; the default's counterpart of (15).
struct WeightedMotion {
  Eigen::Vector3d motion = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};
WeightedMotion weighted_mean(const WeightedMotion& a, const WeightedMotion& b);
/// Squared Mahalanobis distance of two motions.
double squared_distance(const WeightedMotion& a, const WeightedMotion& b);

}  // namespace roadfix
