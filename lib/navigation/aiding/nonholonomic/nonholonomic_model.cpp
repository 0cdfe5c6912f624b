#include "navigation/aiding/nonholonomic/nonholonomic_model.h"

#include "geometry/so3.h"
#include "navigation/aiding/axle_rows.h"

namespace roadfix::navigation {

namespace {

/// Adds to h = u_y what the rear tyres slip, k |u_x| times the lateral acceleration u_x w_z.
void add_slip(const State& state, const BodyMotion& motion, const AxleRows& axle, Measurement<1>& m) {
  const Eigen::Vector2d& mounting = state.x.mounting;
  const Eigen::Matrix3d to_vehicle = vehicle::R_imu_vehicle(mounting).transpose();
  const Eigen::Vector3d rate = to_vehicle * motion.rate;
  const Eigen::Matrix3d J = right_jacobian(Eigen::Vector3d(0.0, mounting.x(), mounting.y()));
  const double speed = std::abs(axle.value.x()), k = state.x.rear_slip;
  m.residual(0) -= k * speed * axle.value.x() * rate.z();
  m.H += 2.0 * k * speed * rate.z() * axle.H.row(0);
  m.H.block<1, 3>(0, kGyroBias) -= k * speed * axle.value.x() * to_vehicle.row(2);
  m.H.block<1, 2>(0, kMounting) += k * speed * axle.value.x() * (skew(rate) * J).row(2).tail<2>();
  m.H(0, kRearSlip) = speed * axle.value.x() * rate.z();
}

}  // namespace

Measurement<1> nonholonomic(const State& state, const BodyMotion& motion, int axis, double sigma) {
  const AxleRows axle(state, motion, 0.0);
  Measurement<1> m;
  m.residual(0) = -axle.value(axis);
  m.H = axle.H.row(axis);
  if (axis == 1) add_slip(state, motion, axle, m);
  m.R(0, 0) = sigma * sigma;
  return m;
}

}  // namespace roadfix::navigation
