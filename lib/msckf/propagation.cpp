#include "msckf/propagation.h"

#include <cmath>

#include "geometry/so3.h"

namespace roadfix::msckf {

namespace {

// The Earth's rate across the vertical is a gyro bias that turns with the heading: by about this much per radian.
constexpr double kEarthRate = 5.0e-5;  // rad/s, at 47 degrees of latitude

}  // namespace

Propagation::Propagation(const MsckfVehicle& vehicle)
    : gravity_(vehicle.gravity),
      gyro_noise_(vehicle.gyro_noise),
      accel_noise_(vehicle.accel_noise),
      // A Gauss-Markov process over times far shorter than it lasts.
      gyro_walk_(std::sqrt(2.0 / vehicle.correlation_s) * vehicle.gyro_bias_std),
      accel_walk_(std::sqrt(2.0 / vehicle.correlation_s) * vehicle.accel_bias_std) {}

void Propagation::step(ImuState& x, const Eigen::Vector3d& gyro, const Eigen::Vector3d& accel, double dt) {
  const Eigen::Vector3d w = x.rate(gyro), f = x.force(accel);
  const Eigen::Vector3d gravity(0.0, 0.0, -gravity_);
  const Eigen::Matrix3d R = (x.q * exp_q(0.5 * dt * w)).toRotationMatrix();  // in the middle
  const Eigen::Vector3d dv = dt * (R * f + gravity);
  const Eigen::Vector3d v = x.v + 0.5 * dv;
  const Eigen::Vector3d p = x.p + 0.5 * dt * (x.v + 0.25 * dv);
  x.q = (x.q * exp_q(dt * w)).normalized();
  x.p += dt * v;
  x.v += dv;

  Eigen::Matrix<double, 3, 6> turned, pushed;  // what biases and scales do within the step
  const Eigen::Vector3d ones = Eigen::Vector3d::Ones();
  turned << dt * R * (ones - x.gyro_scale).asDiagonal(), dt * R * (gyro - x.gyro_bias).asDiagonal();
  pushed << dt * R * (ones - x.accel_scale).asDiagonal(), dt * R * (accel - x.accel_bias).asDiagonal();
  turned_angle_ += dt * w.norm();
  const Eigen::Matrix3d G = skew(gravity), V = skew(v), X = skew(p);
  const Eigen::Matrix<double, 3, 6> vel_before = vel_gyro_, accel_before = vel_accel_;
  vel_gyro_ += dt * G * (att_gyro_ - 0.5 * turned) - V * turned;
  att_gyro_ -= turned;
  pos_gyro_ += 0.5 * dt * (vel_before + vel_gyro_) - X * turned;
  vel_accel_ -= pushed;
  pos_accel_ += 0.5 * dt * (accel_before + vel_accel_);

  Matrix9d F = Matrix9d::Identity();
  F.block<3, 3>(3, 0) = dt * G;
  F.block<3, 3>(6, 0) = 0.5 * dt * dt * G;
  F.block<3, 3>(6, 3).diagonal().setConstant(dt);
  Eigen::Matrix<double, 9, 3> turn_noise;
  turn_noise << Eigen::Matrix3d::Identity(), V, X;
  Q_ = (F * Q_ * F.transpose()).eval();
  const double q_gyro = gyro_noise_ * gyro_noise_ * dt;
  const double q_accel = accel_noise_ * accel_noise_ * dt;
  Q_ += q_gyro * turn_noise * turn_noise.transpose();
  Q_.block<3, 3>(3, 3).diagonal().array() += q_accel;
  Q_.block<3, 3>(3, 6).diagonal().array() += 0.5 * q_accel * dt;
  Q_.block<3, 3>(6, 3).diagonal().array() += 0.5 * q_accel * dt;
  Q_.block<3, 3>(6, 6).diagonal().array() += q_accel * dt * dt / 3.0;
  T_ += dt;
}

Eigen::Matrix<double, 9, kImuSize> Propagation::transition() const {
  Eigen::Matrix<double, 9, kImuSize> F;
  F.setZero();
  F.leftCols<9>().setIdentity();
  const Eigen::Matrix3d G = skew({0.0, 0.0, -gravity_});
  F.block<3, 3>(kVel, kAtt) = T_ * G;
  F.block<3, 3>(kPos, kAtt) = 0.5 * T_ * T_ * G;
  F.block<3, 3>(kPos, kVel).diagonal().setConstant(T_);
  F.block<3, 3>(kAtt, kGyroBias) = att_gyro_.leftCols<3>();
  F.block<3, 3>(kAtt, kGyroScale) = att_gyro_.rightCols<3>();
  F.block<3, 3>(kVel, kGyroBias) = vel_gyro_.leftCols<3>();
  F.block<3, 3>(kVel, kGyroScale) = vel_gyro_.rightCols<3>();
  F.block<3, 3>(kPos, kGyroBias) = pos_gyro_.leftCols<3>();
  F.block<3, 3>(kPos, kGyroScale) = pos_gyro_.rightCols<3>();
  F.block<3, 3>(kVel, kAccelBias) = vel_accel_.leftCols<3>();
  F.block<3, 3>(kVel, kAccelScale) = vel_accel_.rightCols<3>();
  F.block<3, 3>(kPos, kAccelBias) = pos_accel_.leftCols<3>();
  F.block<3, 3>(kPos, kAccelScale) = pos_accel_.rightCols<3>();
  return F;
}

void Propagation::apply(State& state, const MsckfAiding& aiding) {
  if (T_ <= 0.0) return;
  const Eigen::Matrix<double, 9, kImuSize> F = transition();
  const int n = state.size();
  Eigen::MatrixXd& P = state.P();
  Eigen::Matrix<double, 9, kMaxSize> rows;
  rows.leftCols(n).noalias() = F * P.topLeftCorner(kImuSize, n);
  Matrix9d own = Q_;
  own.noalias() += rows.leftCols<kImuSize>() * F.transpose();
  P.topLeftCorner<9, 9>() = 0.5 * (own + own.transpose());
  P.block(0, 9, 9, n - 9) = rows.middleCols(9, n - 9);
  P.block(9, 0, n - 9, 9) = rows.middleCols(9, n - 9).transpose();
  if (state.held()) state.expected().head<9>() = (F * state.expected().head<kImuSize>()).eval();
  const auto walk = [&](int at, int width, double std_per_rts) {
    P.diagonal().segment(at, width).array() += std_per_rts * std_per_rts * T_;
  };
  walk(kGyroBias, 3, gyro_walk_);
  P.diagonal().segment(kGyroBias, 3).array() += kEarthRate * kEarthRate * turned_angle_;
  walk(kAccelBias, 3, accel_walk_);
  walk(kWheelScale, 1, aiding.wheel_scale_walk);
  walk(kMounting, 2, aiding.mounting_walk);
  clear();
}

void Propagation::clear() {
  T_ = turned_angle_ = 0.0;
  for (Eigen::Matrix<double, 3, 6>* sum : {&att_gyro_, &vel_gyro_, &pos_gyro_, &vel_accel_, &pos_accel_})
    sum->setZero();
  Q_.setZero();
}

}  // namespace roadfix::msckf
