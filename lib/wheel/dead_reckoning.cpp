#include "wheel/dead_reckoning.h"

#include <cmath>

namespace roadfix {
namespace {

/// Ratio of chord to arc, sin(h) / h with h half the angle turned (W.4.3), and its derivative.
struct Chord {
  double ratio = 1.0;
  double slope = 0.0;
};

Chord chord(double h) {
  if (std::abs(h) < 1e-4) return {1.0 - h * h / 6.0, -h / 3.0};  // next terms h^4 / 120, h^3 / 30: below rounding
  return {std::sin(h) / h, (std::cos(h) - std::sin(h) / h) / h};
}

}  // namespace

Eigen::Vector3d displacement(const ArcStep& t, StepForm form) {
  const double half = form == StepForm::kArc ? 0.5 * t.yaw_change : 0.0;
  const double direction = t.yaw + half + t.crab_angle;
  const double level = t.distance * chord(half).ratio * std::cos(t.pitch);
  return {level * std::cos(direction), level * std::sin(direction), -t.distance * std::sin(t.pitch)};
}

Eigen::Matrix<double, 3, 5> displacement_jacobian(const ArcStep& t, StepForm form) {
  const bool arc = form == StepForm::kArc;
  const double half = arc ? 0.5 * t.yaw_change : 0.0;
  const Chord c = chord(half);
  const double cos_d = std::cos(t.yaw + half + t.crab_angle), sin_d = std::sin(t.yaw + half + t.crab_angle);
  const double level = t.distance * c.ratio * std::cos(t.pitch);
  const Eigen::Vector3d by_direction(-level * sin_d, level * cos_d, 0.0);
  const double stretch = t.distance * c.slope * std::cos(t.pitch);
  Eigen::Matrix<double, 3, 5> J;
  J.col(0) = by_direction;
  J.col(1) = (arc ? 0.5 : 0.0) * (by_direction + Eigen::Vector3d(stretch * cos_d, stretch * sin_d, 0.0));
  J.col(2) =
      Eigen::Vector3d(c.ratio * std::cos(t.pitch) * cos_d, c.ratio * std::cos(t.pitch) * sin_d, -std::sin(t.pitch));
  J.col(3) = Eigen::Vector3d(-t.distance * c.ratio * std::sin(t.pitch) * cos_d,
                             -t.distance * c.ratio * std::sin(t.pitch) * sin_d, -t.distance * std::cos(t.pitch));
  J.col(4) = by_direction;
  return J;
}

}  // namespace roadfix
