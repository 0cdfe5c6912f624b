#include "papers/arbitration.h"

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

}  // namespace roadfix
