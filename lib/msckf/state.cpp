#include "msckf/state.h"

#include <algorithm>
#include <cstring>

#include "geometry/so3.h"

namespace roadfix::msckf {

Eigen::Matrix3d Calibrated::R_imu_vehicle() const { return exp_so3({0.0, mounting.x(), mounting.y()}); }

State::State() : P_(Eigen::MatrixXd::Zero(kMaxSize, kMaxSize)), expected_(Eigen::VectorXd::Zero(kMaxSize)) {
  clones.reserve(kMaxClones);
  landmarks.reserve(kMaxLandmarks);
}

const Clone* State::find_clone(int64_t id) const {
  const auto found =
      std::lower_bound(clones.begin(), clones.end(), id, [](const Clone& c, int64_t wanted) { return c.id < wanted; });
  return found != clones.end() && found->id == id ? &*found : nullptr;
}

const Clone& State::clone(int64_t id) const { return *find_clone(id); }

void State::reset(const Eigen::Matrix<double, kBaseSize, kBaseSize>& P) {
  clones.clear();
  landmarks.clear();
  size_ = kBaseSize;
  P_.setZero();
  P_.topLeftCorner<kBaseSize, kBaseSize>() = P;
  expected_.setZero();
  held_ = false;
}

void State::correct(const Eigen::VectorXd& d) {
  if (held_) {
    expected_.head(size_) += d.head(size_);
  } else {
    retract(d);
  }
}

void State::hold(const Eigen::Matrix<double, kBaseSize, 1>& base) {
  held_ = true;
  expected_.setZero();
  expected_.head<kBaseSize>() = base;
}

void State::release() {
  if (!held_) return;
  held_ = false;
  retract(expected_);
  expected_.setZero();
}

void State::retract(const Eigen::VectorXd& d) {
  const auto part = [&](int at) { return Eigen::Vector3d(d.segment<3>(at)); };
  const Eigen::Quaterniond dq = exp_q(part(kAtt));
  turn(dq, imu.q);
  imu.v = dq * imu.v + part(kVel);
  imu.p = dq * imu.p + part(kPos);
  imu.gyro_bias += part(kGyroBias);
  imu.accel_bias += part(kAccelBias);
  imu.gyro_scale += part(kGyroScale);
  imu.accel_scale += part(kAccelScale);
  camera.T_imu_camera.q = (camera.T_imu_camera.q * exp_q(part(kCameraTurn))).normalized();
  camera.T_imu_camera.p += part(kCameraPlace);
  camera.lens += d.segment<3>(kLens);
  camera.time_offset += d(kTimeOffset);
  camera.wheel_scale += d(kWheelScale);
  camera.mounting += d.segment<2>(kMounting);
  camera.p_imu_axle += d.segment<3>(kAxle);
  for (Clone& c : clones) {
    const Eigen::Matrix3d dR = exp_so3(part(c.at));
    c.R = Eigen::Quaterniond(dR * c.R).normalized().toRotationMatrix();
    c.p = dR * c.p + part(c.at + 3);
  }
  for (Landmark& l : landmarks) l.f += part(l.at);
}

void State::subtract(const Eigen::Ref<const Eigen::MatrixXd>& Y) {
  auto P = P_.topLeftCorner(size_, size_);
  P.selfadjointView<Eigen::Lower>().rankUpdate(Y, -1.0);
  P.triangularView<Eigen::StrictlyUpper>() = P.transpose();
}

int State::grow(int width) {
  const int at = size_;
  size_ += width;
  P_.block(at, 0, width, size_).setZero();
  P_.block(0, at, size_, width).setZero();
  expected_.segment(at, width).setZero();
  return at;
}

void State::erase(int at, int width) {
  const int behind = size_ - at - width;
  for (int j = at; j < at + behind; ++j) P_.col(j).head(size_) = P_.col(j + width).head(size_);
  for (int j = 0; j < size_ - width; ++j) {
    double* column = P_.col(j).data();
    std::memmove(column + at, column + at + width, static_cast<size_t>(behind) * sizeof(double));
  }
  for (int j = at; j < at + behind; ++j) expected_(j) = expected_(j + width);
  size_ -= width;
  const auto moved = [&](int& a) { a = a > at ? a - width : a; };
  for (Clone& c : clones) moved(c.at);
  for (Landmark& l : landmarks) moved(l.at);
}

void State::remove_clone(int64_t id) {
  const auto found = std::find_if(clones.begin(), clones.end(), [&](const Clone& c) { return c.id == id; });
  const int at = found->at;
  clones.erase(found);
  erase(at, 6);
}

void State::remove_landmark(int64_t track) {
  const auto found =
      std::find_if(landmarks.begin(), landmarks.end(), [&](const Landmark& l) { return l.track == track; });
  const int at = found->at;
  landmarks.erase(found);
  erase(at, 3);
}

void State::add_clone(int64_t id, const Eigen::Vector3d& rate, double jitter) {
  const Eigen::Vector3d w = imu.q * rate;
  Vector6d J_time;  // of (phi, rho) by the moment of the picture
  J_time << w, imu.v - w.cross(imu.p);
  const int old = size_;
  const int at = grow(6);
  Eigen::Matrix<double, 6, kMaxSize> rows;
  rows.topRows<3>().leftCols(old) = P_.block(kAtt, 0, 3, old);
  rows.bottomRows<3>().leftCols(old) = P_.block(kPos, 0, 3, old);
  for (int j = 0; j < old; ++j) rows.col(j) += J_time * P_(kTimeOffset, j);
  Matrix6d own;
  own.leftCols<3>() = rows.middleCols<3>(kAtt);
  own.rightCols<3>() = rows.middleCols<3>(kPos);
  own += rows.col(kTimeOffset) * J_time.transpose();
  own += jitter * jitter * J_time * J_time.transpose();
  P_.block(at, 0, 6, old) = rows.leftCols(old);
  P_.block(0, at, old, 6) = rows.leftCols(old).transpose();
  P_.block<6, 6>(at, at) = 0.5 * (own + own.transpose());
  if (held_) {
    expected_.segment<3>(at) = expected_.segment<3>(kAtt);
    expected_.segment<3>(at + 3) = expected_.segment<3>(kPos);
    expected_.segment<6>(at) += J_time * expected_(kTimeOffset);
  }
  clones.push_back({id, at, imu.R(), imu.p});
}

void State::digest(Digest& digest) const {
  digest.add(imu.t_us);
  for (const Eigen::Vector3d& x :
       {imu.v, imu.p, imu.gyro_bias, imu.accel_bias, imu.gyro_scale, imu.accel_scale, camera.T_imu_camera.p})
    digest.add(x);
  digest.add(Eigen::Vector4d(imu.q.coeffs()));
  digest.add(Eigen::Vector4d(camera.T_imu_camera.q.coeffs()));
  digest.add(camera.lens);
  digest.add(camera.time_offset);
  digest.add(camera.wheel_scale);
  digest.add(camera.mounting);
  digest.add(camera.p_imu_axle);
  for (const Clone& c : clones) {
    digest.add(c.R);
    digest.add(c.p);
  }
  for (const Landmark& l : landmarks) digest.add(l.f);
  digest.add(Eigen::MatrixXd(P_.topLeftCorner(size_, size_)));
}

}  // namespace roadfix::msckf
