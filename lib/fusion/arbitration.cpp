#include "fusion/arbitration.h"

#include <cmath>

#include "geometry/so3.h"

namespace roadfix {
namespace {

double middle(double a, double b) { return wrap_angle(a + 0.5 * wrap_angle(b - a)); }

}  // namespace

double printed_difference(const PaperPose& wheels, const PaperPose& visual) {
  const double position = std::sqrt((wheels.position - visual.position).squaredNorm() / 2.0);
  const Eigen::Vector3d angles(wrap_angle(wheels.angles.roll - visual.angles.roll),
                               wrap_angle(wheels.angles.pitch - visual.angles.pitch),
                               wrap_angle(wheels.angles.yaw - visual.angles.yaw));
  return position * std::sqrt(angles.squaredNorm() / 3.0) / 3.0;
}

Arbitrated printed_arbitration(const PaperPose& wheels, const PaperPose& visual, double threshold) {
  if (printed_difference(wheels, visual) > threshold) return {wheels, false};
  PaperPose mean;
  mean.position = 0.5 * (wheels.position + visual.position);
  mean.angles = {middle(wheels.angles.yaw, visual.angles.yaw), middle(wheels.angles.pitch, visual.angles.pitch),
                 middle(wheels.angles.roll, visual.angles.roll)};
  return {mean, true};
}

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
