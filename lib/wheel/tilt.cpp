#include "wheel/tilt.h"

#include <cmath>

#include "geometry/so3.h"

namespace roadfix {

Tilt tilt_of_gravity(const Eigen::Vector3d& f) {
  return {std::atan2(f.y(), f.z()), std::atan2(-f.x(), std::hypot(f.y(), f.z()))};
}

Eigen::Matrix<double, 2, 3> tilt_of_gravity_jacobian(const Eigen::Vector3d& f) {
  const double yz2 = f.y() * f.y() + f.z() * f.z();
  const double yz = std::sqrt(yz2);
  const double norm2 = f.squaredNorm();
  Eigen::Matrix<double, 2, 3> J;
  J << 0.0, f.z() / yz2, -f.y() / yz2,  //
      -yz / norm2, f.x() * f.y() / (yz * norm2), f.x() * f.z() / (yz * norm2);
  return J;
}

Tilt printed_tilt(const Eigen::Vector3d& f) {
  return {std::atan2(f.x(), std::hypot(f.y(), f.z())), std::atan2(f.y(), std::hypot(f.x(), f.z()))};
}

Eigen::Vector3d euler_rates(const Tilt& tilt, const Eigen::Vector3d& omega) {
  return euler_rates_by_omega(tilt) * omega;
}

Eigen::Matrix3d euler_rates_by_omega(const Tilt& tilt) {
  const double sr = std::sin(tilt.roll), cr = std::cos(tilt.roll);
  const double sp = std::sin(tilt.pitch), cp = std::cos(tilt.pitch);
  Eigen::Matrix3d E;
  E << 1.0, sr * sp / cp, cr * sp / cp,  //
      0.0, cr, -sr,                      //
      0.0, sr / cp, cr / cp;
  return E;
}

Eigen::Matrix<double, 3, 2> euler_rates_by_tilt(const Tilt& tilt, const Eigen::Vector3d& omega) {
  const double sr = std::sin(tilt.roll), cr = std::cos(tilt.roll);
  const double sp = std::sin(tilt.pitch), cp = std::cos(tilt.pitch);
  const double across = omega.y() * cr - omega.z() * sr;  // d upward / d roll
  const double upward = omega.y() * sr + omega.z() * cr;
  Eigen::Matrix<double, 3, 2> J;
  J << across * sp / cp, upward / (cp * cp),  //
      -upward, 0.0,                           //
      across / cp, upward * sp / (cp * cp);
  return J;
}

double accelerometer_share(double dt_s, double time_constant_s) { return dt_s / (time_constant_s + dt_s); }

Tilt blend(const Tilt& predicted, const Tilt& measured, double share) {
  return {wrap_angle(predicted.roll + share * wrap_angle(measured.roll - predicted.roll)),
          predicted.pitch + share * (measured.pitch - predicted.pitch)};
}

}  // namespace roadfix
