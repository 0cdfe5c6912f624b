#include "geometry/so3.h"
#include "gnss_ins/aiding.h"

namespace roadfix {

namespace {

// Velocity of the vehicle's origin in vehicle axes, and its Jacobian, (M.27).
struct VehicleVelocity {
  Eigen::Vector3d value;
  Eigen::Matrix<double, 3, kStates> H = Eigen::Matrix<double, 3, kStates>::Zero();
  Eigen::Vector3d rate;  // of the vehicle, vehicle axes
  Eigen::Matrix<double, 3, 2> rate_mounting;

  VehicleVelocity(const NavState& x, const BodyMotion& motion, double ahead, const Eigen::Vector3d& lever) {
    const Eigen::Matrix3d R = x.q_enu_imu.toRotationMatrix();
    const Eigen::Matrix3d to_vehicle = x.R_imu_vehicle().transpose();
    const Eigen::Vector3d v = x.velocity + ahead * motion.acceleration;
    value = to_vehicle * (R.transpose() * v + motion.rate.cross(lever));
    const Eigen::Matrix3d J = right_jacobian(Eigen::Vector3d(0.0, x.mounting.x(), x.mounting.y()));
    H.middleCols<3>(kVel) = to_vehicle * R.transpose();
    H.middleCols<3>(kAtt) = to_vehicle * R.transpose() * skew(v);
    H.middleCols<3>(kGyroBias) = to_vehicle * skew(lever);
    H.middleCols<2>(kMounting) = (skew(value) * J).rightCols<2>();
    rate = to_vehicle * motion.rate;
    rate_mounting = (skew(rate) * J).rightCols<2>();
  }
};

}  // namespace

Measurement<1> wheel_speed(const NavState& x, const BodyMotion& motion, double speed, double sigma, double ahead,
                           const Eigen::Vector3d& p_imu_vehicle) {
  const VehicleVelocity v(x, motion, ahead, p_imu_vehicle);
  const double gain = 1.0 / (1.0 + x.wheel_scale);
  Measurement<1> m;
  m.residual(0) = speed - gain * v.value.x();
  m.H = gain * v.H.row(0);
  m.H(0, kWheelScale) = -gain * gain * v.value.x();
  m.R(0, 0) = sigma * sigma;
  return m;
}

Measurement<2> no_sideslip(const NavState& x, const BodyMotion& motion, const Eigen::Vector3d& p_imu_vehicle) {
  const VehicleVelocity v(x, motion, 0.0, p_imu_vehicle);
  // At x behind the origin: v + rate x (-x, 0, 0), (M.29).
  const double behind = x.no_slip_x;
  Measurement<2> m;
  m.residual = -Eigen::Vector2d(v.value.y() - v.rate.z() * behind, v.value.z() + v.rate.y() * behind);
  m.H = v.H.bottomRows<2>();
  m.H.block<1, 2>(0, kMounting) -= behind * v.rate_mounting.row(2);
  m.H.block<1, 2>(1, kMounting) += behind * v.rate_mounting.row(1);
  const Eigen::Matrix3d rate_bias = -x.R_imu_vehicle().transpose();
  m.H.block<1, 3>(0, kGyroBias) -= behind * rate_bias.row(2);
  m.H.block<1, 3>(1, kGyroBias) += behind * rate_bias.row(1);
  m.H(0, kNoSlipX) = -v.rate.z();
  m.H(1, kNoSlipX) = v.rate.y();
  return m;
}

}  // namespace roadfix
