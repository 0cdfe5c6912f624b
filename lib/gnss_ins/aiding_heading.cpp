#include <cmath>

#include "geometry/so3.h"
#include "gnss_ins/aiding.h"

namespace roadfix {

namespace {

// Angle of a direction's shadow on the level plane and its derivative to the direction.
struct Bearing {
  double angle;
  Eigen::RowVector3d slope;
  explicit Bearing(const Eigen::Vector3d& d) : angle(std::atan2(d.y(), d.x())) {
    slope = Eigen::RowVector3d(-d.y(), d.x(), 0.0) / (d.x() * d.x() + d.y() * d.y());
  }
};

// R_enu_vehicle's derivative with the two mounting angles, applied to a fixed vector of the vehicle, (M.26).
Eigen::Matrix<double, 3, 2> mounting_slope(const NavState& x, const Eigen::Vector3d& in_vehicle) {
  const Eigen::Matrix3d R = x.q_enu_imu.toRotationMatrix() * x.R_imu_vehicle();
  const Eigen::Matrix3d J = right_jacobian(Eigen::Vector3d(0.0, x.mounting.x(), x.mounting.y()));
  return (-R * skew(in_vehicle) * J).rightCols<2>();
}

}  // namespace

Measurement<1> vehicle_yaw(const NavState& x, double yaw, double sigma) {
  const Eigen::Vector3d forward = x.q_enu_imu * (x.R_imu_vehicle() * Eigen::Vector3d::UnitX());
  const Bearing bearing(forward);
  Measurement<1> m;
  m.residual(0) = wrap_angle(yaw - bearing.angle);
  m.H.block<1, 3>(0, kAtt) = -bearing.slope * skew(forward);
  m.H.block<1, 2>(0, kMounting) = bearing.slope * mounting_slope(x, Eigen::Vector3d::UnitX());
  m.R(0, 0) = sigma * sigma;
  return m;
}

Measurement<1> magnetic_heading(const NavState& x, const Eigen::Vector3d& field, double declination, double sigma) {
  const Eigen::Vector3d unit = field.normalized();
  const Eigen::Vector3d north = x.q_enu_imu * (x.R_imu_vehicle() * unit);
  const Bearing bearing(north);
  Measurement<1> m;
  m.residual(0) = wrap_angle(0.5 * M_PI - declination - bearing.angle);
  m.H.block<1, 3>(0, kAtt) = -bearing.slope * skew(north);
  m.H.block<1, 2>(0, kMounting) = bearing.slope * mounting_slope(x, unit);
  m.R(0, 0) = sigma * sigma;
  return m;
}

}  // namespace roadfix
