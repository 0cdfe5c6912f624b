#include "geometry/euler.h"

#include <cmath>

#include "geometry/so3.h"

namespace roadfix {
namespace {

/// cos(pitch) below which roll and yaw are not distinguished: 1e-9 rad from the pole, where their difference is lost
/// to rounding.
constexpr double kGimbalLock = 1e-9;

}  // namespace

YawPitchRoll yaw_pitch_roll(const Eigen::Matrix3d& R) {
  YawPitchRoll a;
  const double cos_pitch = std::hypot(R(0, 0), R(1, 0));
  a.pitch = std::atan2(-R(2, 0), cos_pitch);
  if (cos_pitch > kGimbalLock) {
    a.yaw = std::atan2(R(1, 0), R(0, 0));
    a.roll = std::atan2(R(2, 1), R(2, 2));
  } else {
    // With roll = 0 the middle column is (-sin yaw, cos yaw, 0) at either pole. The papers' (13-a), (13-b) differ from
    // each other only by letters.
    a.yaw = std::atan2(-R(0, 1), R(1, 1));
    a.roll = 0.0;
  }
  return a;
}

YawPitchRoll yaw_pitch_roll(const Eigen::Quaterniond& q) { return yaw_pitch_roll(q.toRotationMatrix()); }

Eigen::Quaterniond quaternion(const YawPitchRoll& a) {
  const Eigen::AngleAxisd z(a.yaw, Eigen::Vector3d::UnitZ());
  const Eigen::AngleAxisd y(a.pitch, Eigen::Vector3d::UnitY());
  const Eigen::AngleAxisd x(a.roll, Eigen::Vector3d::UnitX());
  return z * y * x;
}

double yaw_of(const Eigen::Quaterniond& q) {
  return std::atan2(2.0 * (q.w() * q.z() + q.x() * q.y()), 1.0 - 2.0 * (q.y() * q.y() + q.z() * q.z()));
}

double yaw_between(const Eigen::Quaterniond& from, const Eigen::Quaterniond& to) {
  const Eigen::Quaterniond turn = to * from.conjugate();
  return wrap_angle(2.0 * std::atan2(turn.z(), turn.w()));
}

}  // namespace roadfix
