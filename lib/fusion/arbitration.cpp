#include "fusion/arbitration.h"

#include "geometry/so3.h"

namespace roadfix {

void compare(AgreementState& a, const AgreementConfig& config, double distance) {
  const bool against = a.agrees ? distance > config.gate : distance < config.clear;
  a.count = against ? a.count + 1 : 0;
  if (a.count < (a.agrees ? config.bad_after : config.good_after)) return;
  a.agrees = !a.agrees;
  a.count = 0;
}

WeightedMotion weighted_mean(const WeightedMotion& a, const WeightedMotion& b) {
  Eigen::Vector3d d = b.motion - a.motion;
  d.z() = wrap_angle(d.z());
  const Eigen::Matrix3d K = a.covariance * (a.covariance + b.covariance).inverse();
  WeightedMotion mean{a.motion + K * d, a.covariance - K * a.covariance};
  mean.motion.z() = wrap_angle(mean.motion.z());
  return mean;
}

double squared_distance(const WeightedMotion& a, const WeightedMotion& b) {
  Eigen::Vector3d d = b.motion - a.motion;
  d.z() = wrap_angle(d.z());
  return d.dot((a.covariance + b.covariance).ldlt().solve(d));
}

}  // namespace roadfix
