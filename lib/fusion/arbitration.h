/// Do the camera and the wheels agree? A normalised test on relative motion with hysteresis (MODEL.md, section 7); the printed test of
/// Ock et al. (2020) is in papers/arbitration.h.
#pragma once

#include <Eigen/Dense>

namespace roadfix {

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
