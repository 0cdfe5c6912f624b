#include "navigation/aiding/second_order.h"

#include <array>
#include <cmath>

#include "geometry/frames.h"
#include "geometry/so3.h"
#include "vehicle/axle_velocity.h"

namespace roadfix::navigation {

namespace {

constexpr double kSureHeading = 0.5 * kDegree;
// What is left out is the same function of the same errors until fixes have changed these: a second, as they come.
constexpr double kErrorsLast = 1.0;      // s
constexpr double kLeastInterval = 0.01;  // s

using Errors = Eigen::Matrix<double, 9, 9>;
constexpr int kW = 0, kA = 3, kG = 6;  // of the velocity, of attitude and mounting together, of the mounting

/// Covariance of (w, a, g), vehicle axes.
Errors errors(const State& state) {
  const Eigen::Matrix3d to_vehicle = vehicle::R_imu_vehicle(state.x.mounting).transpose() * state.x.R().transpose();
  Eigen::Matrix<double, 9, 8> T = Eigen::Matrix<double, 9, 8>::Zero();
  const Eigen::Matrix<double, 3, 2> by_mounting =
      right_jacobian(Eigen::Vector3d(0.0, state.x.mounting.x(), state.x.mounting.y())).rightCols<2>();
  T.block<3, 3>(kA, 0) = T.block<3, 3>(kW, 3) = to_vehicle;
  T.block<3, 2>(kA, 6) = T.block<3, 2>(kG, 6) = by_mounting;
  static_assert(kAtt == 0 && kVel == 3);
  const Eigen::MatrixXd& P = state.P();
  Eigen::Matrix<double, 8, 8> of;
  of << P.block<6, 6>(kAtt, kAtt), P.block<6, 2>(kAtt, kMounting), P.block<2, 6>(kMounting, kAtt),
      P.block<2, 2>(kMounting, kMounting);
  const Eigen::Matrix<double, 9, 8> half = T.lazyProduct(of);
  return half.lazyProduct(T.transpose());
}

}  // namespace

SecondOrder second_order(const State& state) {
  const double speed = (state.x.R().transpose() * state.x.nav.velocity).x();
  // g x (g x u) / 2 - a x w, u along x, as quadratic forms.
  std::array<Errors, 3> forms;
  for (Errors& B : forms) B.setZero();
  const auto set = [&](size_t axis, int i, int k, double value) { forms[axis](i, k) = forms[axis](k, i) = value; };
  for (int axis = 0; axis < 3; ++axis) {
    const int next = (axis + 1) % 3, last = (axis + 2) % 3;
    set(static_cast<size_t>(axis), kA + next, kW + last, -0.5);
    set(static_cast<size_t>(axis), kA + last, kW + next, 0.5);
  }
  set(0, kG + 1, kG + 1, -0.5 * speed);
  set(0, kG + 2, kG + 2, -0.5 * speed);
  set(1, kG + 0, kG + 1, 0.25 * speed);
  set(2, kG + 0, kG + 2, 0.25 * speed);
  const Errors S = errors(state);
  SecondOrder out;
  for (size_t axis = 0; axis < forms.size(); ++axis) {
    const Errors BS = forms[axis].lazyProduct(S);
    out.mean(static_cast<int>(axis)) = BS.trace();
    out.variance(static_cast<int>(axis)) = 2.0 * BS.cwiseProduct(BS.transpose()).sum();
  }
  return out;
}

void add_second_order(Measurement<1>& m, const Filter& filter, int axis, double gain, double interval) {
  if (filter.heading_std() < kSureHeading) return;
  const SecondOrder left_out = second_order(filter.state());
  const double rho = std::exp(-std::max(interval, kLeastInterval) / kErrorsLast);
  m.residual(0) -= gain * left_out.mean(axis);
  m.R(0, 0) += gain * gain * left_out.variance(axis);
  m.repeated = gain * gain * left_out.variance(axis) * (2.0 * rho / (1.0 - rho));
}

/// e = offset - latency, w the velocity's error: e w + A e^2 / 2.
void add_second_order(Measurement<3>& m, const State& state, const BodyMotion& motion) {
  const Eigen::MatrixXd& P = state.P();
  const double late =
      P(kPositionLatency, kPositionLatency) + P(kImuOffset, kImuOffset) - 2.0 * P(kPositionLatency, kImuOffset);
  const Eigen::Matrix3d v = skew(state.x.nav.velocity);
  for (int i = 0; i < 3; ++i) {
    Eigen::Matrix<double, 1, 6> w = Eigen::Matrix<double, 1, 6>::Zero();
    w.head<3>() = -v.row(i);
    w(3 + i) = 1.0;
    const double both = w.dot(P.block<6, 1>(kAtt, kImuOffset) - P.block<6, 1>(kAtt, kPositionLatency));
    const double velocity = (w * P.block<6, 6>(kAtt, kAtt) * w.transpose())(0, 0), a = motion.acceleration(i);
    m.residual(i) -= both + 0.5 * a * late;
    m.R(i, i) += late * velocity + both * both + 2.0 * a * late * both + 0.5 * a * a * late * late;
  }
}

}  // namespace roadfix::navigation
