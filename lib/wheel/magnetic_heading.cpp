#include "wheel/magnetic_heading.h"

#include <cmath>

namespace roadfix {
namespace {

/// Ry(pitch) Rx(roll), (W.2.1).
Eigen::Matrix3d tilt(double roll, double pitch) {
  return (Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) * Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

}  // namespace

Eigen::Vector3d level_field(const Eigen::Vector3d& field, double roll, double pitch) {
  return tilt(roll, pitch) * field;
}

std::optional<MagneticYaw> magnetic_yaw(const Eigen::Vector3d& field, double roll, double pitch) {
  const Eigen::Matrix3d R = tilt(roll, pitch);
  const Eigen::Vector3d level = R * field;
  const double squared = level.head<2>().squaredNorm();
  if (!(squared > 0.0) || !std::isfinite(squared)) return std::nullopt;

  MagneticYaw result;
  result.yaw = std::atan2(-level.y(), level.x());
  const Eigen::RowVector2d by_level(level.y() / squared, -level.x() / squared);
  const Eigen::Vector2d by_roll(std::sin(pitch) * level.y(),
                                -(field.y() * std::sin(roll) + field.z() * std::cos(roll)));
  const Eigen::Vector2d by_pitch(level.z(), 0.0);
  result.by_tilt << by_level.dot(by_roll), by_level.dot(by_pitch);
  result.by_field = by_level * R.topRows<2>();
  return result;
}

double printed_magnetic_heading(const Eigen::Vector3d& m, double roll, double pitch) {
  const double x = m.x() * std::cos(pitch) + m.y() * std::sin(roll) - m.z() * std::cos(roll) * std::sin(pitch);
  const double y = m.y() * std::cos(roll) + m.z() * std::sin(pitch);
  return std::atan2(-y, x);  // equation 7 with the quadrant, and the sign that is right at zero tilt
}

}  // namespace roadfix
