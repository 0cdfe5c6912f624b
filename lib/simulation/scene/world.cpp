#include "simulation/scene/world.h"

#include <cmath>

#include "geometry/so3.h"

namespace roadfix {
namespace {

/// Lane point before the car's middle, the one after it, and the share of the distance between them.
struct LanePlace {
  std::size_t before, after;
  double share;
};

LanePlace place(const MovingObject& m, double t_s) {
  const auto length = static_cast<double>(m.lane.size());
  double s = std::fmod(m.start_m + m.speed * t_s, length);
  if (s < 0.0) s += length;
  const auto i = std::min(static_cast<std::size_t>(s), m.lane.size() - 1);
  return {i, (i + 1) % m.lane.size(), s - static_cast<double>(i)};
}

/// Along the lane, smoothed over its neighbours so that the car does not turn in steps.
Eigen::Vector3d direction(const MovingObject& m, const LanePlace& at) {
  const std::size_t n = m.lane.size();
  const auto chord = [&](std::size_t i) -> Eigen::Vector3d { return m.lane[(i + 2) % n] - m.lane[(i + n - 2) % n]; };
  return ((1.0 - at.share) * chord(at.before) + at.share * chord(at.after)).normalized();
}

}  // namespace

SE3 MovingObject::pose(double t_s) const {
  const LanePlace at = place(*this, t_s);
  const Eigen::Vector3d x = direction(*this, at);
  const Eigen::Vector3d y = Eigen::Vector3d::UnitZ().cross(x).normalized();
  Eigen::Matrix3d R;
  R << x, y, x.cross(y);
  return {Eigen::Quaterniond(R), (1.0 - at.share) * lane[at.before] + at.share * lane[at.after]};
}

Eigen::Vector3d MovingObject::velocity(double t_s) const { return speed * direction(*this, place(*this, t_s)); }

float MovingObject::light(double t_s) const {
  const LanePlace at = place(*this, t_s);
  const auto share = static_cast<float>(at.share);
  return (1.0F - share) * lane_light[at.before] + share * lane_light[at.after];
}

}  // namespace roadfix
