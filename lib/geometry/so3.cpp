#include "geometry/so3.h"

#include <cmath>

#include "geometry/frames.h"

namespace roadfix {
namespace {

/// Below this angle the series are exact to rounding: the first term left out is theta^4 / 120 < 1e-18.
constexpr double kSmallAngle = 1e-4;

}  // namespace

Eigen::Matrix3d skew(const Eigen::Vector3d& a) {
  Eigen::Matrix3d S;
  S << 0.0, -a.z(), a.y(), a.z(), 0.0, -a.x(), -a.y(), a.x(), 0.0;
  return S;
}

Eigen::Quaterniond exp_q(const Eigen::Vector3d& theta) {
  const double angle_squared = theta.squaredNorm();
  if (angle_squared < kSmallAngle * kSmallAngle) {
    const double k = 0.5 - angle_squared / 48.0;
    return Eigen::Quaterniond(1.0 - angle_squared / 8.0, k * theta.x(), k * theta.y(), k * theta.z()).normalized();
  }
  const double angle = std::sqrt(angle_squared);
  const double k = std::sin(0.5 * angle) / angle;
  return {std::cos(0.5 * angle), k * theta.x(), k * theta.y(), k * theta.z()};
}

Eigen::Matrix3d exp_so3(const Eigen::Vector3d& theta) { return exp_q(theta).toRotationMatrix(); }

Eigen::Vector3d log_q(const Eigen::Quaterniond& q) {
  const double sign = q.w() < 0.0 ? -1.0 : 1.0;
  const double w = sign * q.w();
  const Eigen::Vector3d v = sign * q.vec();
  const double n = v.norm();
  if (n < 0.5 * kSmallAngle) return (2.0 / w) * (1.0 - n * n / (3.0 * w * w)) * v;
  return (2.0 * std::atan2(n, w) / n) * v;
}

Eigen::Vector3d log_so3(const Eigen::Matrix3d& R) { return log_q(Eigen::Quaterniond(R)); }

Eigen::Matrix3d right_jacobian(const Eigen::Vector3d& theta) {
  const double a2 = theta.squaredNorm();
  const Eigen::Matrix3d S = skew(theta);
  if (a2 < kSmallAngle * kSmallAngle)
    return Eigen::Matrix3d::Identity() - (0.5 - a2 / 24.0) * S + (1.0 / 6.0 - a2 / 120.0) * S * S;
  const double a = std::sqrt(a2);
  return Eigen::Matrix3d::Identity() - ((1.0 - std::cos(a)) / a2) * S + ((a - std::sin(a)) / (a2 * a)) * S * S;
}

Eigen::Matrix3d right_jacobian_inverse(const Eigen::Vector3d& theta) {
  const double a2 = theta.squaredNorm();
  const Eigen::Matrix3d S = skew(theta);
  if (a2 < kSmallAngle * kSmallAngle) return Eigen::Matrix3d::Identity() + 0.5 * S + (1.0 / 12.0 + a2 / 720.0) * S * S;
  const double a = std::sqrt(a2);
  // (1 + cos a) / (2 a sin a) = cot(a/2) / (2 a), finite up to a = 2 pi.
  const double k = 1.0 / a2 - 1.0 / (2.0 * a * std::tan(0.5 * a));
  return Eigen::Matrix3d::Identity() + 0.5 * S + k * S * S;
}

Eigen::Quaterniond normalized_positive(const Eigen::Quaterniond& q) {
  const Eigen::Quaterniond n = q.normalized();
  return n.w() < 0.0 ? Eigen::Quaterniond(-n.w(), -n.x(), -n.y(), -n.z()) : n;
}

double wrap_angle(double angle) {
  if (angle > -kPi && angle <= kPi) return angle;  // as the remainder is, which takes 20 ns
  const double wrapped = std::remainder(angle, 2.0 * kPi);
  return wrapped <= -kPi ? kPi : wrapped;
}

}  // namespace roadfix
