#include "navigation/filter.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "geodesy/gravity.h"
#include "geometry/so3.h"

namespace roadfix::navigation {

namespace {

// Rate and acceleration are smoothed over this time: long enough against vibration, short against a car's manoeuvres.
constexpr double kMotionTime = 0.05;  // s
constexpr double kShownSigmas = 3.0;  // of latencies, that the state waits for

// How long a receiver takes to settle after it has lost all signals is nobody's promise: its loops pull in within a
// second, its smoothing of codes by carriers (Hatch 1982) and its own filter within some. Prior: 0.75 to 8 s at one
// standard deviation, and ten seconds later it may be another by a factor of 2.6.
constexpr double kFadeTime = 2.5;      // s
constexpr double kFadeSpread = 1.2;    // of the logarithm
constexpr double kFadeWalk = 0.3;      // of the logarithm, 1/sqrt(s)
constexpr double kHeadingTime = 30.0;  // s, in which a road turns by a radian

constexpr int kMostConsidered = 8;  // states: the receiver's and the imu's clocks, an antenna

double square(double x) { return x * x; }

// How large steps are (assumed): a tyre that loses pressure or a wheel set that is changed, biases as much as they
// differ from one turn-on to the next, a receiver that follows a reflection or is dragged off, a clock that is set by
// another one, an arm that was read off wrong. Without an imu there is no clock of its own.
StepDetector::Sizes typical_steps(const VehicleFacts& v) {
  constexpr double kScale = 0.02, kArm = 0.5, kDisplacement = 5.0, kDrag = 0.5, kClock = 0.05;  // 1, m, m, m/s, s
  StepDetector::Sizes s;
  s << kScale, Eigen::Vector3d::Constant(v.gyro_bias_std), Eigen::Vector3d::Constant(v.accel_bias_std),
      Eigen::Vector3d::Constant(kDisplacement), Eigen::Vector3d::Constant(kDrag), v.has_imu ? kClock : 0.0, kClock,
      kClock, Eigen::Vector3d::Constant(kArm);
  return s;
}

}  // namespace

Filter::Filter(const NavigationConfig& config, const inertial::Earth& earth, bool camera)
    : config_(config),
      earth_(earth),
      state_(camera),
      steps_(typical_steps(config.facts)),
      scratch_(Eigen::VectorXd::Zero(state_.P().rows())) {}

void Filter::initialise(const Mean& mean, const BaseVector& std) {
  state_.reset(mean, std.cwiseAbs2());
  sums_ = inertial::TransitionSums();
  last_ = inertial::InertialStep();
  motion_ = BodyMotion();
  steps_.stop();
}

void Filter::adopt(const Filter& other, const CameraFacts& camera) {
  Mean mean;
  mean.T_imu_camera = camera.T_imu_camera;
  mean.T_left_right = camera.T_left_right;
  mean.camera_offset = camera.offset;
  BaseVector std = BaseVector::Zero();
  std.segment<3>(kCameraTurn).setConstant(std::max(camera.turn_std, config_.camera.turn_floor));
  std.segment<3>(kCameraPlace).setConstant(std::max(camera.place_std, config_.camera.place_floor));
  if (camera.right) {
    std.segment<3>(kRightTurn).setConstant(camera.right_turn_std);
  } else {
    std.segment<3>(kLens) = Eigen::Vector3d(camera.focal_std, camera.radial_std, camera.radial4_std);
  }
  std(kCameraOffset) = camera.offset_std;
  adopt(other, mean, std);
}

void Filter::adopt_without_camera(const Filter& other) { adopt(other, Mean(), BaseVector::Zero()); }

void Filter::adopt(const Filter& other, const Mean& camera, const BaseVector& std) {
  state_.adopt(other.state_, camera, std.cwiseAbs2());
  earth_ = other.earth_;
  sums_ = other.sums_;
  last_ = other.last_;
  motion_ = other.motion_;
  gnss_bias_ = other.gnss_bias_;
}

void integrate(Mean& x, inertial::InertialStep& last, BodyMotion& motion, inertial::Earth& earth, const ImuSample& imu,
               double dt) {
  const inertial::InertialStep step = x.corrected(imu.gyro, imu.accel, dt);
  const Eigen::Vector3d v_before = x.nav.velocity;
  const Eigen::Vector3d earth_rate = x.nav.q_level_imu.conjugate() * earth.rate();
  inertial::mechanise(x.nav, last, step, earth);
  x.t_us = imu.t_us;
  const double weight = last.dt > 0.0 ? dt / (dt + kMotionTime) : 1.0;
  motion.rate += weight * (step.rate - earth_rate - motion.rate);
  motion.acceleration += weight * ((1.0 / dt) * (x.nav.velocity - v_before) - motion.acceleration);
  last = step;
}

void Filter::predict(const ImuSample& imu, double dt, const inertial::ImuNoise& noise) {
  Mean& x = state_.x;
  sums_.add(x.nav, x.corrected(imu.gyro, imu.accel, dt), noise);
  const Eigen::Vector3d before = x.nav.velocity;
  integrate(x, last_, motion_, earth_, imu, dt);
  motion_.lag.advance(x.nav.velocity - before, dt);
  for (int i = 0; i < 3; ++i) x.gnss_bias(i) *= inertial::gauss_markov_decay(dt, gnss_bias_.position_time(i));
  x.gnss_velocity_bias *= inertial::gauss_markov_decay(dt, gnss_bias_.velocity_time);
  if (returning()) x.gnss_return *= std::exp(-dt * std::exp(x.return_rate));
  if (sums_.duration() >= config_.process.covariance_interval - 1e-9) flush();
}

inertial::ErrorTransition Filter::transition() const {
  inertial::Earth earth = earth_;
  return sums_.transition(state_.x.nav, state_.p_ref, earth.gravity(state_.x.nav.position), earth.rate());
}

Filter::Diagonal Filter::diagonal(double T) const {
  Diagonal d;
  d.decay.setOnes();
  d.noise.setZero();
  const VehicleFacts& v = config_.facts;
  const ProcessNoise& p = config_.process;
  // (N.2.4): the in-run part of biases and scales walks; what is beyond it is constant since turn-on.
  const double walk = 2.0 * T / v.correlation_s;
  d.noise.segment<3>(kGyroBias) = walk * square(std::min(v.gyro_bias_std, p.gyro_drift_max)) * v.measured_rates();
  d.noise.segment<3>(kAccelBias).setConstant(walk * square(std::min(v.accel_bias_std, p.accel_drift_max)));
  d.noise.segment<6>(kGyroScale).setConstant(walk * square(v.scale_std));
  if (!earth_.anchored() && v.has_imu) {  // (N.2.10): where nobody knows the Earth's rate, biases hold it
    const double turned = 2.0 * T / kHeadingTime, coriolis = 2.0 * kEarthRate * state_.x.nav.velocity.norm();
    d.noise.segment<3>(kGyroBias).array() += turned * square(kEarthRate);
    d.noise.segment<3>(kAccelBias).array() += turned * square(coriolis);
  }
  // What the calibration calls exact stays put.
  if (v.wheel_scale_std > 0.0) d.noise(kWheelScale) = square(p.wheel_scale_walk) * T;
  for (int i = 0; i < 2; ++i)
    if (v.mounting_std(1 + i) > 0.0) d.noise(kMounting + i) = square(p.mounting_walk) * T;
  for (int i = 0; i < 3; ++i)
    if (v.p_imu_antenna_std(i) > 0.0) d.noise(kAntenna + i) = square(p.antenna_walk) * T;
  const ClockPriors time(v);
  const double clock = square(p.clock_walk) * T;
  if (time.imu_offset > 0.0) d.noise(kImuOffset) = clock;
  if (time.position_latency > 0.0 && v.time_offset_std > 0.0) d.noise(kPositionLatency) = clock;
  if (time.wheel_latency > 0.0 && v.time_offset_std > 0.0 && time.imu_offset == 0.0) d.noise(kWheelLatency) = clock;
  const double velocity_decay = inertial::gauss_markov_decay(T, gnss_bias_.velocity_time);
  for (int i = 0; i < 3; ++i) {
    const double decay = inertial::gauss_markov_decay(T, gnss_bias_.position_time(i));
    d.decay(kGnssBias + i) = decay;
    d.noise(kGnssBias + i) =
        (1.0 - square(decay)) * square(gnss_bias_.position_std(i)) + square(gnss_bias_.position_walk(i)) * T;
  }
  d.decay.segment<3>(kGnssVelocityBias).setConstant(velocity_decay);
  d.noise.segment<3>(kGnssVelocityBias) = (1.0 - square(velocity_decay)) * gnss_bias_.velocity_std.cwiseAbs2();
  if (returning()) {
    d.decay.segment<3>(kGnssReturn).setConstant(std::exp(-T * std::exp(state_.x.return_rate)));
    d.noise(kReturnRate) = square(kFadeWalk) * T;
  }
  return d;
}

Eigen::Vector3d Filter::by_return_rate(double T) const {
  return -T * std::exp(state_.x.return_rate) * state_.x.gnss_return;
}

void Filter::flush() {
  const double T = sums_.duration();
  if (T <= 0.0) return;
  inertial::ErrorTransition step = transition();
  // Without poses in the state the reference point stays at the position, (N.1.5).
  if (state_.clones.empty()) {
    const Eigen::Matrix3d D = skew(state_.x.nav.position - state_.p_ref);
    inertial::Matrix9d move = inertial::Matrix9d::Identity();
    move.block<3, 3>(kPos, kAtt) = -D;
    step.F = (move * step.F).eval();
    step.Q = (move * step.Q * move.transpose()).eval();
    state_.p_ref = state_.x.nav.position;
  }
  steps_.move(state_, step.F, diagonal(T).decay, T);
  const int n = state_.size();
  Eigen::MatrixXd& P = state_.P();
  Eigen::Matrix<double, 9, Eigen::Dynamic, 0, 9, kMaxSize> rows(9, n);
  rows.noalias() = step.F.lazyProduct(P.topLeftCorner(kInertialSize, n));
  inertial::Matrix9d own = step.Q;
  own.noalias() += rows.leftCols<kInertialSize>().lazyProduct(step.F.transpose());
  const Diagonal d = diagonal(T);
  if (state_.held()) state_.expected().head<9>() = (step.F * state_.expected().head<kInertialSize>()).eval();
  for (int k = kGnssBias; k < kReturnRate; ++k) {  // the only states that decay
    P.row(k).head(n) *= d.decay(k);
    P.col(k).head(n) *= d.decay(k);
    rows.col(k) *= d.decay(k);
  }
  if (returning()) {
    const Eigen::Vector3d by_rate = by_return_rate(T);
    for (int i = 0; i < 3; ++i) {
      rows.col(kGnssReturn + i) += by_rate(i) * rows.col(kReturnRate);
      P.row(kGnssReturn + i).head(n) += by_rate(i) * P.row(kReturnRate).head(n);
    }
    for (int i = 0; i < 3; ++i) P.col(kGnssReturn + i).head(n) += by_rate(i) * P.col(kReturnRate).head(n);
    for (int i = 0; i < 3; ++i) P.row(kGnssReturn + i).head(n) = P.col(kGnssReturn + i).head(n).transpose();
  }
  P.topLeftCorner<9, 9>() = 0.5 * (own + own.transpose());
  P.block(0, 9, 9, n - 9) = rows.rightCols(n - 9);
  P.block(9, 0, n - 9, 9) = rows.rightCols(n - 9).transpose();
  P.diagonal().head<kWithoutCamera>() += d.noise;
  sums_ = inertial::TransitionSums();
}

template <int Rows>
Eigen::Matrix<double, Rows, kWithoutCamera> Filter::at_epoch(const Measurement<Rows>& m) const {
  Eigen::Matrix<double, Rows, kWithoutCamera> H = m.H;
  const double T = sums_.duration();
  if (T <= 0.0) return H;
  H.template leftCols<9>().setZero();
  H = H * diagonal(T).decay.asDiagonal();
  H.template leftCols<kInertialSize>() += m.H.template leftCols<9>() * transition().F;
  if (returning()) H.col(kReturnRate) += m.H.template middleCols<3>(kGnssReturn) * by_return_rate(T);
  return H;
}

template <int Rows>
Eigen::Matrix<double, Rows, Rows> Filter::innovation_covariance(const Measurement<Rows>& m) const {
  const Eigen::Matrix<double, Rows, kWithoutCamera> H = at_epoch(m);
  Eigen::Matrix<double, Rows, Rows> S = m.R;
  if (const double T = sums_.duration(); T > 0.0) {  // as if the covariance had been moved
    const Eigen::Matrix<double, Rows, 9> moved = m.H.template leftCols<9>();
    S += moved * transition().Q * moved.transpose();
    S += m.H * diagonal(T).noise.asDiagonal() * m.H.transpose();
  }
  S += H * state_.P().template topLeftCorner<kWithoutCamera, kWithoutCamera>() * H.transpose();
  return 0.5 * (S + S.transpose());
}

template <int Rows>
Eigen::Matrix<double, Rows, 1> Filter::residual(const Measurement<Rows>& m) const {
  Eigen::Matrix<double, Rows, 1> r = m.residual;
  if (!state_.held()) return r;
  for (int k = 0; k < kWithoutCamera; ++k)
    for (int i = 0; i < Rows; ++i) r(i) -= m.H(i, k) * state_.expected()(k);
  return r;
}

template <int Rows>
void Filter::reject(const Measurement<Rows>& m) {
  const Innovation<Rows> innovation(m.residual, innovation_covariance(m));
  if (innovation.usable) steps_.reject<Rows>(state_, at_epoch(m), innovation.L, innovation.whitened);
}

template <int Rows>
AidingRecord Filter::judge(AidingSource source, int64_t t_us, const Measurement<Rows>& m, double gate) const {
  const Innovation<Rows> innovation(residual(m), innovation_covariance(m));
  AidingRecord r = record_of(source, AidingStatus::kBadInput, t_us);
  r.dof = Rows;
  r.nis = innovation.nis;
  r.log_likelihood = innovation.log_likelihood;
  for (int i = 0; i < Rows; ++i) {
    r.innovation[static_cast<size_t>(i)] = m.residual(i);
    r.innovation_variance[static_cast<size_t>(i)] = innovation.S(i, i);
  }
  if (innovation.usable) r.status = innovation.nis <= gate ? AidingStatus::kAccepted : AidingStatus::kGated;
  return r;
}

template <int Rows>
void Filter::apply(const Measurement<Rows>& m, bool evidence) {
  const int n = state_.size();
  const Eigen::MatrixXd& P = state_.P();
  using Gain = Eigen::Matrix<double, Eigen::Dynamic, Rows, 0, kMaxSize, Rows>;
  Gain Y = Gain::Zero(n, Rows);
  for (int k = 0; k < kWithoutCamera; ++k)  // most of H is zero
    for (int r = 0; r < Rows; ++r)
      if (m.H(r, k) != 0.0) Y.col(r) += m.H(r, k) * P.col(k).head(n);
  Eigen::Matrix<double, Rows, Rows> S = m.H.lazyProduct(Y.template topRows<kWithoutCamera>()) + m.R;
  S.diagonal().array() += m.repeated;
  const Innovation<Rows> innovation(residual(m), 0.5 * (S + S.transpose()));
  if (!innovation.usable) return;
  for (int i = 0; i < Rows; ++i) {  // Y L^-T, (N.3.2)
    for (int k = 0; k < i; ++k) Y.col(i) -= innovation.L(i, k) * Y.col(k);
    Y.col(i) /= innovation.L(i, i);
  }
  std::array<int, kMostConsidered> list{};
  size_t count = 0;
  for (const Considered& c : {considered_, m.considered})
    for (int i = 0; i < c.size; ++i) list[count++] = c.first + i;
  const std::span<const int> kept(list.data(), count);  // states without a gain, (N.3.4)
  using Kept = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMostConsidered, kMostConsidered>;
  const Kept cov = P(kept, kept);
  state_.subtract(Y);
  state_.P()(kept, kept) = cov;
  for (const int i : kept) Y.row(i).setZero();
  steps_.use<Rows>(state_, m.H, innovation.L, innovation.whitened, Y, evidence);
  scratch_.head(n) = Y.lazyProduct(innovation.whitened);
  state_.correct(scratch_);
}

template <int Rows>
AidingRecord Filter::fuse(AidingSource source, int64_t t_us, const Measurement<Rows>& m, double gate) {
  if (state_.held()) flush();
  const AidingRecord record = judge(source, t_us, m, gate);
  if (record.status == AidingStatus::kGated) reject(m);
  if (record.status != AidingStatus::kAccepted) return record;
  flush();
  // Slow, a scale does not show, and the noise of speeds without a sign is rectified.
  constexpr double kSlow = 2.0;  // m/s
  apply(m, state_.x.nav.velocity.squaredNorm() > kSlow * kSlow);
  return record;
}

std::optional<StepDetector::Step> Filter::mend_step(double sigmas, bool displaced) {
  if (!steps_.take_fresh() || !steps_.most_likely(sigmas, displaced)) {
    steps_.advance(state_, motion_, displaced);
    return std::nullopt;
  }
  flush();
  const std::optional<StepDetector::Step> step = steps_.most_likely(sigmas, displaced);
  const int n = state_.size();
  const auto per_unit = state_.carried().middleCols(step->column, step->size.size()).topRows(n);
  scratch_.head(n) = per_unit * step->size;
  state_.retract(scratch_);
  const auto widen = [&] {
    for (int j = 0; j < n; ++j) state_.P().col(j).head(n) += scratch_(j) * scratch_.head(n);
  };
  const StepDetector::Small root = step->cov.llt().matrixL();
  for (int k = 0; k < root.cols(); ++k) {
    scratch_.head(n) = per_unit * root.col(k);
    widen();
  }
  if (const auto doubt = steps_.doubted(*step, state_.x.t_us)) {
    scratch_.head(n) = doubt->size * state_.carried().col(doubt->column).head(n);
    widen();
  }
  steps_.take(*step, state_, motion_);
  return step;
}

void Filter::reset_block(int at, const Eigen::Vector3d& value, const Eigen::Vector3d& std) {
  flush();
  const int n = state_.size();
  Eigen::MatrixXd& P = state_.P();
  P.middleRows<3>(at).leftCols(n).setZero();
  P.middleCols<3>(at).topRows(n).setZero();
  P.diagonal().segment<3>(at) = std.cwiseAbs2();
  state_.carried().middleRows<3>(at).setZero();
  if (at == kGnssBias) state_.x.gnss_bias = value;
  if (at == kGnssVelocityBias) state_.x.gnss_velocity_bias = value;
}

void Filter::begin_return(const Eigen::Vector3d& std) {
  end_return();
  state_.x.return_rate = -std::log(kFadeTime);
  state_.P().diagonal().segment<4>(kGnssReturn) << std.cwiseAbs2(), square(kFadeSpread);
}

void Filter::end_return() {
  flush();
  const int n = state_.size();
  state_.P().middleRows<4>(kGnssReturn).leftCols(n).setZero();
  state_.P().middleCols<4>(kGnssReturn).topRows(n).setZero();
  state_.carried().middleRows<4>(kGnssReturn).setZero();
  state_.x.gnss_return.setZero();
  state_.x.return_rate = 0.0;
}

double Filter::return_size() const {
  const Eigen::Vector2d variance = state_.P().diagonal().segment<2>(kGnssReturn);
  return std::sqrt((state_.x.gnss_return.head<2>().cwiseAbs2() + variance).maxCoeff());
}

void Filter::rescale_gnss_bias(int at, double ratio) {
  flush();
  const int n = state_.size();
  const Eigen::Vector3d& value = at == kGnssBias ? state_.x.gnss_bias : state_.x.gnss_velocity_bias;
  auto d = scratch_.head(n);
  for (int k = at; k < at + 3; ++k) {
    const double variance = state_.P()(k, k);
    if (!(variance > 0.0)) continue;
    const double root = std::sqrt(std::abs(ratio - 1.0) / variance);
    d = root * state_.P().col(k).head(n);
    if (ratio > 1.0) {  // makes unsure and moves nothing: no better mean is found by stretching what a prior has held
      for (int j = 0; j < n; ++j) state_.P().col(j).head(n) += d(j) * d;
      continue;
    }
    state_.subtract(d);
    d *= root;
    for (int j = 0; j < state_.carried().cols(); ++j) {
      auto step = state_.carried().col(j).head(n);
      step -= step(k) * d;
    }
    d *= -value(k - at);
    state_.correct(scratch_);
  }
}

void Filter::widen(const BaseVector& d) {
  flush();
  state_.P().topLeftCorner<kWithoutCamera, kWithoutCamera>() +=
      (d.head<kWithoutCamera>() * d.head<kWithoutCamera>().transpose()).eval();
}

void Filter::tie_frame(const inertial::Earth& earth, double yaw, double yaw_std, const Eigen::Vector3d& local_place,
                       const Eigen::Vector3d& place) {
  constexpr double kOpenPlace = 100.0;  // m, until the fix that tells it is used
  flush();
  const Eigen::Quaterniond turn = exp_q({0.0, 0.0, yaw});
  const Eigen::Vector3d gravity_before = earth_.gravity(state_.x.nav.position);
  state_.change_frame(yaw, place - turn * local_place, yaw_std, kOpenPlace);
  motion_.acceleration = turn * motion_.acceleration;
  motion_.lag = VelocityLag();
  earth_ = earth;
  // Biases held what a local frame does not know of the Earth; how much of it is what their priors left.
  const Eigen::Matrix3d to_imu = state_.x.R().transpose();
  BaseVector unknown = BaseVector::Zero();
  unknown.segment<3>(kGyroBias) = to_imu * earth_.rate();
  widen(unknown);
  unknown.setZero();
  unknown.segment<3>(kAccelBias) = to_imu * (earth_.gravity(state_.x.nav.position) - gravity_before);
  widen(unknown);
}

double Filter::longest_age(bool wheels) const {
  double longest = 0.0;
  const Mean& x = state_.x;
  const Eigen::MatrixXd& P = state_.P();
  for (const auto& [at, value] :
       {std::pair{kPositionLatency, x.position_latency}, std::pair{kVelocityLatency, x.velocity_latency},
        std::pair{kWheelLatency, x.wheel_latency}}) {
    if (at == kWheelLatency && !wheels) continue;
    const double variance = P(at, at) + P(kImuOffset, kImuOffset) - 2.0 * P(at, kImuOffset);
    longest = std::max(longest, value - x.imu_offset + kShownSigmas * std::sqrt(std::max(variance, 0.0)));
  }
  if (state_.has_camera()) {
    const double sigma = std::sqrt(state_.P()(kCameraOffset, kCameraOffset));
    longest = std::max(longest, kShownSigmas * sigma - x.camera_offset);
  }
  return longest;
}

double Filter::heading_std() const { return std::sqrt(state_.P()(kAtt + 2, kAtt + 2)); }

#define ROADFIX_INSTANTIATE(ROWS)                                                              \
  template AidingRecord Filter::fuse(AidingSource, int64_t, const Measurement<ROWS>&, double); \
  template void Filter::reject(const Measurement<ROWS>&);                                      \
  template AidingRecord Filter::judge(AidingSource, int64_t, const Measurement<ROWS>&, double) const;
ROADFIX_INSTANTIATE(1)
ROADFIX_INSTANTIATE(2)
ROADFIX_INSTANTIATE(3)
#undef ROADFIX_INSTANTIATE

}  // namespace roadfix::navigation
