#include "navigation/state.h"

#include <algorithm>
#include <cstring>

#include "geometry/so3.h"

namespace roadfix::navigation {

namespace {

Eigen::Vector3d part(const Eigen::Ref<const Eigen::VectorXd>& d, int at) { return d.segment<3>(at); }

void retract_base(Mean& x, const Eigen::Ref<const Eigen::VectorXd>& d, const Eigen::Vector3d& p_ref, bool camera) {
  const Eigen::Quaterniond dq = exp_q(part(d, kAtt));
  x.nav.q_level_imu = (dq * x.nav.q_level_imu).normalized();
  x.nav.velocity = dq * x.nav.velocity + part(d, kVel);
  x.nav.position = p_ref + dq * (x.nav.position - p_ref) + part(d, kPos);
  x.gyro_bias += part(d, kGyroBias);
  x.accel_bias += part(d, kAccelBias);
  x.gyro_scale += part(d, kGyroScale);
  x.accel_scale += part(d, kAccelScale);
  x.wheel_scale += d(kWheelScale);
  x.mounting += d.segment<2>(kMounting);
  x.rear_slip += d(kRearSlip);
  x.p_imu_axle += part(d, kAxle);
  x.p_imu_antenna += part(d, kAntenna);
  x.position_latency += d(kPositionLatency);
  x.velocity_latency += d(kVelocityLatency);
  x.imu_offset += d(kImuOffset);
  x.wheel_latency += d(kWheelLatency);
  x.gnss_bias += part(d, kGnssBias);
  x.gnss_velocity_bias += part(d, kGnssVelocityBias);
  x.gnss_return += part(d, kGnssReturn);
  x.return_rate += d(kReturnRate);
  if (!camera) return;
  x.T_imu_camera.q = (x.T_imu_camera.q * exp_q(part(d, kCameraTurn))).normalized();
  x.T_imu_camera.p += part(d, kCameraPlace);
  x.T_left_right.q = (x.T_left_right.q * exp_q(part(d, kRightTurn))).normalized();
  x.lens += part(d, kLens);
  x.camera_offset += d(kCameraOffset);
  x.track_drift += part(d, kTrackDrift);
}

}  // namespace

inertial::InertialStep Mean::corrected(const Eigen::Vector3d& gyro, const Eigen::Vector3d& accel, double dt) const {
  inertial::InertialStep s;
  s.dt = dt;
  s.rate = (gyro - gyro_bias).cwiseProduct((1.0 - gyro_scale.array()).matrix());
  s.specific_force = (accel - accel_bias).cwiseProduct((1.0 - accel_scale.array()).matrix());
  return s;
}

Mean retract(const Mean& x, const BaseVector& d, const Eigen::Vector3d& p_ref) {
  Mean y = x;
  retract_base(y, d, p_ref, true);
  return y;
}

BaseVector local(const Mean& x, const Mean& y, const Eigen::Vector3d& p_ref) {
  BaseVector d;
  const Eigen::Quaterniond dq = y.nav.q_level_imu * x.nav.q_level_imu.conjugate();
  d.segment<3>(kAtt) = log_q(dq);
  d.segment<3>(kVel) = y.nav.velocity - dq * x.nav.velocity;
  d.segment<3>(kPos) = y.nav.position - p_ref - dq * (x.nav.position - p_ref);
  d.segment<3>(kGyroBias) = y.gyro_bias - x.gyro_bias;
  d.segment<3>(kAccelBias) = y.accel_bias - x.accel_bias;
  d.segment<3>(kGyroScale) = y.gyro_scale - x.gyro_scale;
  d.segment<3>(kAccelScale) = y.accel_scale - x.accel_scale;
  d(kWheelScale) = y.wheel_scale - x.wheel_scale;
  d.segment<2>(kMounting) = y.mounting - x.mounting;
  d(kRearSlip) = y.rear_slip - x.rear_slip;
  d.segment<3>(kAxle) = y.p_imu_axle - x.p_imu_axle;
  d.segment<3>(kAntenna) = y.p_imu_antenna - x.p_imu_antenna;
  d(kPositionLatency) = y.position_latency - x.position_latency;
  d(kVelocityLatency) = y.velocity_latency - x.velocity_latency;
  d(kImuOffset) = y.imu_offset - x.imu_offset;
  d(kWheelLatency) = y.wheel_latency - x.wheel_latency;
  d.segment<3>(kGnssBias) = y.gnss_bias - x.gnss_bias;
  d.segment<3>(kGnssVelocityBias) = y.gnss_velocity_bias - x.gnss_velocity_bias;
  d.segment<3>(kGnssReturn) = y.gnss_return - x.gnss_return;
  d(kReturnRate) = y.return_rate - x.return_rate;
  d.segment<3>(kCameraTurn) = log_q(x.T_imu_camera.q.conjugate() * y.T_imu_camera.q);
  d.segment<3>(kCameraPlace) = y.T_imu_camera.p - x.T_imu_camera.p;
  d.segment<3>(kRightTurn) = log_q(x.T_left_right.q.conjugate() * y.T_left_right.q);
  d.segment<3>(kLens) = y.lens - x.lens;
  d(kCameraOffset) = y.camera_offset - x.camera_offset;
  d.segment<3>(kTrackDrift) = y.track_drift - x.track_drift;
  return d;
}

State::State(bool camera)
    : base_(camera ? kBaseSize : kWithoutCamera),
      size_(base_),
      P_(Eigen::MatrixXd::Zero(camera ? kMaxSize : kWithoutCamera, camera ? kMaxSize : kWithoutCamera)),
      expected_(Eigen::VectorXd::Zero(P_.rows())),
      carried_(P_.rows(), 0) {
  if (!camera) return;
  clones.reserve(kMaxClones);
  points.reserve(kMaxPoints);
}

const Clone* State::find_clone(int64_t id) const {
  const auto found =
      std::lower_bound(clones.begin(), clones.end(), id, [](const Clone& c, int64_t wanted) { return c.id < wanted; });
  return found != clones.end() && found->id == id ? &*found : nullptr;
}

void State::reset(const Mean& mean, const BaseVector& variance) {
  x = mean;
  p_ref = mean.nav.position;
  clones.clear();
  points.clear();
  size_ = base_;
  P_.setZero();
  P_.diagonal().head(base_) = variance.head(base_);
  expected_.setZero();
  carried_.setZero();
  held_ = false;
}

void State::adopt(const State& other, const Mean& camera, const BaseVector& variance) {
  Mean mean = other.x;
  mean.T_imu_camera = camera.T_imu_camera;
  mean.T_left_right = camera.T_left_right;
  mean.lens = camera.lens;
  mean.camera_offset = camera.camera_offset;
  mean.track_drift = camera.track_drift;
  reset(mean, variance);
  p_ref = other.p_ref;
  P_.topLeftCorner<kWithoutCamera, kWithoutCamera>() = other.P_.topLeftCorner<kWithoutCamera, kWithoutCamera>();
}

void State::drop_clones() {
  clones.clear();
  points.clear();
  size_ = base_;
}

void State::drop_points() {
  while (!points.empty()) remove_point(points.back().track);
}

void State::correct(const Eigen::Ref<const Eigen::VectorXd>& d) {
  if (held_) {
    expected_.head(size_) += d.head(size_);
  } else {
    retract(d);
  }
}

void State::decay_track_drift(double decay, double variance) {
  x.track_drift *= decay;
  P_.middleRows<3>(kTrackDrift).leftCols(size_) *= decay;
  P_.middleCols<3>(kTrackDrift).topRows(size_) *= decay;
  P_.diagonal().segment<3>(kTrackDrift).array() += variance;
  expected_.segment<3>(kTrackDrift) *= decay;
  carried_.middleRows<3>(kTrackDrift) *= decay;
}

void State::hold(const BaseVector& base) {
  held_ = true;
  expected_.setZero();
  expected_.head(base_) = base.head(base_);
}

void State::release() {
  if (!held_) return;
  held_ = false;
  retract(expected_);
  expected_.setZero();
}

void State::retract(const Eigen::Ref<const Eigen::VectorXd>& d) {
  retract_base(x, d, p_ref, has_camera());
  for (Clone& c : clones) {
    const Eigen::Matrix3d dR = exp_so3(part(d, c.at));
    c.R = Eigen::Quaterniond(dR * c.R).normalized().toRotationMatrix();
    c.p = p_ref + dR * (c.p - p_ref) + part(d, c.at + 3);
  }
  for (Point& p : points) p.f += part(d, p.at);
}

void State::subtract(const Eigen::Ref<const Eigen::MatrixXd>& Y) {
  if (Y.cols() <= 3) {  // an element and its mirror are the same sum of the same products, none of them fused
    for (int j = 0; j < size_; ++j)
      for (int r = 0; r < Y.cols(); ++r) P_.col(j).head(size_) -= Y(j, r) * Y.col(r).head(size_);
    mirror();
    return;
  }
  P_.topLeftCorner(size_, size_).selfadjointView<Eigen::Lower>().rankUpdate(Y, -1.0);
  mirror();
}

void State::mirror() {
  for (int j = 1; j < size_; ++j)
    for (int i = 0; i < j; ++i) P_(i, j) = P_(j, i);
}

void State::move_reference(const Eigen::Vector3d& p) {
  const Eigen::Matrix3d D = skew(p - p_ref);
  p_ref = p;
  const auto move = [&](int att, int pos) {  // T P T', T: rho -= [p_new - p_old]x phi
    P_.block(pos, 0, 3, size_) -= D * P_.block(att, 0, 3, size_).eval();
    P_.block(0, pos, size_, 3) -= P_.block(0, att, size_, 3).eval() * D.transpose();
    if (held_) expected_.segment<3>(pos) -= D * expected_.segment<3>(att);
    carried_.middleRows(pos, 3) -= D.lazyProduct(carried_.middleRows(att, 3));
  };
  move(kAtt, kPos);
  for (const Clone& c : clones) move(c.at, c.at + 3);
  mirror();
}

void State::change_frame(double yaw, const Eigen::Vector3d& p, double yaw_std, double place_std) {
  const Eigen::Quaterniond q = exp_q({0.0, 0.0, yaw});
  const Eigen::Matrix3d R = q.toRotationMatrix();
  x.nav.q_level_imu = (q * x.nav.q_level_imu).normalized();
  x.nav.velocity = R * x.nav.velocity;
  x.nav.position = R * x.nav.position + p;
  for (Eigen::Vector3d* level : {&x.gnss_bias, &x.gnss_velocity_bias, &x.gnss_return}) *level = R * *level;
  p_ref = R * p_ref + p;
  const auto turn = [&](int at) {
    P_.block(at, 0, 3, size_) = R * P_.block(at, 0, 3, size_).eval();
    P_.block(0, at, size_, 3) = P_.block(0, at, size_, 3).eval() * R.transpose();
    carried_.middleRows<3>(at) = (R * carried_.middleRows<3>(at)).eval();
  };
  for (const int at : {kAtt, kVel, kPos, kGnssBias, kGnssVelocityBias, kGnssReturn}) turn(at);
  std::vector<int> poses = {kAtt};
  for (Clone& c : clones) {
    c.R = Eigen::Quaterniond(R * c.R).normalized().toRotationMatrix();
    c.p = R * c.p + p;
    turn(c.at);
    turn(c.at + 3);
    poses.push_back(c.at);
  }
  static_assert(kPos == kAtt + 6);
  const auto place_of = [](int pose) { return pose == kAtt ? kPos : pose + 3; };
  for (const int i : poses)
    for (const int k : poses) {
      P_(i + 2, k + 2) += yaw_std * yaw_std;
      P_.block<3, 3>(place_of(i), place_of(k)).diagonal().array() += place_std * place_std;
    }
  mirror();
}

int State::grow(int width) {
  const int at = size_;
  size_ += width;
  P_.block(at, 0, width, size_).setZero();
  P_.block(0, at, size_, width).setZero();
  expected_.segment(at, width).setZero();
  carried_.middleRows(at, width).setZero();
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
  for (int j = at; j < at + behind; ++j) carried_.row(j) = carried_.row(j + width);
  size_ -= width;
  const auto moved = [&](int& a) { a = a > at ? a - width : a; };
  for (Clone& c : clones) moved(c.at);
  for (Point& p : points) moved(p.at);
}

Point& State::add_point(int64_t track, int64_t anchor, const Eigen::Vector3d& f) {
  return points.emplace_back(Point{track, anchor, grow(3), f});
}

void State::express(const Point& point, const Eigen::Ref<const Eigen::Matrix3Xd>& G, std::span<const StateBlock> blocks,
                    const Eigen::Matrix3d& N) {
  Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, kMaxSize> rows(3, size_);
  rows.setZero();
  Eigen::Vector3d expected = Eigen::Vector3d::Zero();
  Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, kMaxSize> carried(3, carried_.cols());
  carried.setZero();
  int column = 0;
  for (const auto& [at, width] : blocks) {
    const auto own = G.middleCols(column, width);
    rows.noalias() += own * P_.block(at, 0, width, size_);
    expected += own * expected_.segment(at, width);
    carried += own * carried_.middleRows(at, width);
    column += width;
  }
  Eigen::Matrix3d own = N;
  column = 0;
  for (const auto& [at, width] : blocks) {
    own.noalias() += rows.middleCols(at, width) * G.middleCols(column, width).transpose();
    column += width;
  }
  P_.block(point.at, 0, 3, size_) = rows;
  P_.block(0, point.at, size_, 3) = rows.transpose();
  P_.block<3, 3>(point.at, point.at) = 0.5 * (own + own.transpose());
  expected_.segment<3>(point.at) = expected;
  carried_.middleRows<3>(point.at) = carried;
}

bool State::has_point(int64_t track) const {
  return std::any_of(points.begin(), points.end(), [&](const Point& p) { return p.track == track; });
}

void State::remove_point(int64_t track) {
  const auto found = std::find_if(points.begin(), points.end(), [&](const Point& p) { return p.track == track; });
  const int at = found->at;
  points.erase(found);
  erase(at, 3);
}

void State::remove_clone(int64_t id) {
  const auto found = std::find_if(clones.begin(), clones.end(), [&](const Clone& c) { return c.id == id; });
  const int at = found->at;
  clones.erase(found);
  erase(at, 6);
}

void State::add_clone(int64_t id, const Eigen::Vector3d& rate, double jitter) {
  const Eigen::Vector3d w = x.nav.q_level_imu * rate;
  Vector6d J_time;  // of (phi, rho) by the moment of the picture
  J_time << w, x.nav.velocity - w.cross(x.nav.position - p_ref);
  const int old = size_;
  const int at = grow(6);
  Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, kMaxSize> rows(6, old);
  rows.topRows<3>() = P_.block(kAtt, 0, 3, old);
  rows.bottomRows<3>() = P_.block(kPos, 0, 3, old);
  for (int j = 0; j < old; ++j) rows.col(j) += J_time * P_(kCameraOffset, j);
  Matrix6d own;
  own.leftCols<3>() = rows.middleCols<3>(kAtt);
  own.rightCols<3>() = rows.middleCols<3>(kPos);
  own += rows.col(kCameraOffset) * J_time.transpose();
  own += jitter * jitter * J_time * J_time.transpose();
  P_.block(at, 0, 6, old) = rows;
  P_.block(0, at, old, 6) = rows.transpose();
  P_.block<6, 6>(at, at) = 0.5 * (own + own.transpose());
  if (held_) {
    expected_.segment<3>(at) = expected_.segment<3>(kAtt);
    expected_.segment<3>(at + 3) = expected_.segment<3>(kPos);
    expected_.segment<6>(at) += J_time * expected_(kCameraOffset);
  }
  carried_.middleRows<3>(at) = carried_.middleRows<3>(kAtt);
  carried_.middleRows<3>(at + 3) = carried_.middleRows<3>(kPos);
  carried_.middleRows<6>(at) += J_time * carried_.row(kCameraOffset);
  clones.push_back({id, x.t_us, at, x.R(), x.nav.position});
}

void State::digest(Digest& digest) const {
  digest.add(x.t_us);
  digest.add(local(Mean(), x, Eigen::Vector3d::Zero()));
  digest.add(Eigen::Vector4d(x.nav.q_level_imu.coeffs()));
  for (const Clone& c : clones) {
    digest.add(c.R);
    digest.add(c.p);
  }
  for (const Point& p : points) digest.add(p.f);
  digest.add(Eigen::MatrixXd(P_.topLeftCorner(size_, size_)));
}

}  // namespace roadfix::navigation
