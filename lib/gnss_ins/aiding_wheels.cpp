#include <array>

#include "geometry/se3.h"
#include "geometry/so3.h"
#include "gnss_ins/aiding.h"

namespace roadfix {

namespace {

// Velocity of the axle's centre in vehicle axes, and its Jacobian, (M.27).
struct AxleVelocity {
  Eigen::Vector3d value;
  Eigen::Matrix<double, 3, kStates> H = Eigen::Matrix<double, 3, kStates>::Zero();

  AxleVelocity(const NavState& x, const BodyMotion& motion, double ahead) {
    const Eigen::Matrix3d R = x.q_enu_imu.toRotationMatrix();
    const Eigen::Matrix3d to_vehicle = x.R_imu_vehicle().transpose();
    const Eigen::Vector3d v = x.velocity + ahead * motion.acceleration;
    value = to_vehicle * (R.transpose() * v + motion.rate.cross(x.p_imu_axle));
    const Eigen::Matrix3d J = right_jacobian(Eigen::Vector3d(0.0, x.mounting.x(), x.mounting.y()));
    H.middleCols<3>(kVel) = to_vehicle * R.transpose();
    H.middleCols<3>(kAtt) = to_vehicle * R.transpose() * skew(v);
    H.middleCols<3>(kGyroBias) = to_vehicle * skew(x.p_imu_axle);
    H.middleCols<2>(kMounting) = (skew(value) * J).rightCols<2>();
    H.middleCols<3>(kAxle) = to_vehicle * skew(motion.rate);
  }
};

}  // namespace

Measurement<1> wheel_speed(const NavState& x, const BodyMotion& motion, double speed, double sigma, double ahead) {
  const AxleVelocity v(x, motion, ahead);
  const double gain = 1.0 / (1.0 + x.wheel_scale);
  Measurement<1> m;
  m.residual(0) = speed - gain * v.value.x();
  m.H = gain * v.H.row(0);
  m.H(0, kWheelScale) = -gain * gain * v.value.x();
  const double gaining = m.H.segment<3>(kVel) * motion.acceleration;
  m.H(0, kWheelLatency) = -gaining;
  m.H(0, kImuOffset) = gaining;
  m.R(0, 0) = sigma * sigma;
  return m;
}

Measurement<2> no_sideslip(const NavState& x, const BodyMotion& motion) {
  const AxleVelocity v(x, motion, 0.0);
  Measurement<2> m;
  m.residual = -v.value.tail<2>();
  m.H = v.H.bottomRows<2>();
  return m;
}

SecondOrder bent_velocity(const NavState& x, const ErrorMatrix& P) {
  // Errors of the velocity (w) and of the vehicle's attitude (g), both in vehicle axes: u = Exp(-g) (u_hat + w).
  const Eigen::Matrix3d to_imu = x.q_enu_imu.toRotationMatrix().transpose();
  const Eigen::Matrix3d to_vehicle = x.R_imu_vehicle().transpose() * to_imu;
  Eigen::Matrix<double, 6, 8> T = Eigen::Matrix<double, 6, 8>::Zero();
  T.topLeftCorner<3, 3>() = T.block<3, 3>(3, 3) = to_vehicle;
  T.bottomRightCorner<3, 2>() = right_jacobian(Eigen::Vector3d(0.0, x.mounting.x(), x.mounting.y())).rightCols<2>();
  Eigen::Matrix<double, 8, 8> errors;
  errors << P.block<6, 6>(kVel, kVel), P.block<6, 2>(kVel, kMounting), P.block<2, 6>(kMounting, kVel),
      P.block<2, 2>(kMounting, kMounting);
  const Eigen::Matrix<double, 6, 8> half = T.lazyProduct(errors);
  const Matrix6d S = half.lazyProduct(T.transpose());

  // g x (g x u) / 2 - g x w, with u along x, as quadratic forms of (w, g).
  const double quarter = 0.25 * (to_vehicle * x.velocity).x();
  std::array<Matrix6d, 3> forms;
  for (Matrix6d& B : forms) B.setZero();
  const auto set = [&](size_t axis, int i, int k, double value) { forms[axis](i, k) = forms[axis](k, i) = value; };
  set(0, 4, 4, -2.0 * quarter);
  set(0, 5, 5, -2.0 * quarter);
  set(0, 4, 2, -0.5);
  set(0, 5, 1, 0.5);
  set(1, 3, 4, quarter);
  set(1, 5, 0, -0.5);
  set(1, 3, 2, 0.5);
  set(2, 3, 5, quarter);
  set(2, 3, 1, -0.5);
  set(2, 4, 0, 0.5);
  SecondOrder out;
  for (size_t axis = 0; axis < forms.size(); ++axis) {
    const Matrix6d BS = forms[axis].lazyProduct(S);
    out.mean(static_cast<int>(axis)) = BS.trace();
    out.variance(static_cast<int>(axis)) = 2.0 * BS.cwiseProduct(BS.transpose()).sum();
  }
  return out;
}

}  // namespace roadfix
