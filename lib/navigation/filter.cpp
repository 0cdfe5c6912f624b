#include "navigation/filter.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "geometry/so3.h"
#include "statistics/chance.h"
#include "vehicle/driving.h"

namespace roadfix::navigation {

namespace {

constexpr int kMostConsidered = 8;  // states: the receiver's and the imu's clocks, an antenna

}  // namespace

Filter::Filter(const NavigationConfig& config, const inertial::Earth& earth, bool camera)
    : tuning_(config.camera),
      state_(camera),
      propagation_(earth),
      process_(config),
      steps_(config.facts),
      scratch_(Eigen::VectorXd::Zero(state_.P().rows())) {}

void Filter::initialise(const Mean& mean, const BaseVector& std) {
  state_.reset(mean, std.cwiseAbs2());
  propagation_ = Propagation(earth());
  steps_.stop();
}

void Filter::adopt(const Filter& other, const CameraFacts& camera) {
  Mean mean;
  mean.T_imu_camera = camera.T_imu_camera;
  mean.T_left_right = camera.T_left_right;
  mean.camera_offset = camera.offset;
  BaseVector std = BaseVector::Zero();
  std.segment<3>(kCameraTurn).setConstant(std::max(camera.turn_std, tuning_.turn_floor));
  std.segment<3>(kCameraPlace).setConstant(std::max(camera.place_std, tuning_.place_floor));
  if (camera.right) {
    std.segment<3>(kRightTurn).setConstant(camera.right_turn_std);
  } else {
    std.segment<3>(kLens) = Eigen::Vector3d(camera.focal_std, camera.radial_std, camera.radial4_std);
  }
  std(kCameraOffset) = camera.offset_std;
  std.segment<3>(kTrackDrift).setConstant(tuning_.drift);
  adopt(other, mean, std);
}

void Filter::adopt_without_camera(const Filter& other) { adopt(other, Mean(), BaseVector::Zero()); }

void Filter::adopt(const Filter& other, const Mean& camera, const BaseVector& std) {
  state_.adopt(other.state_, camera, std.cwiseAbs2());
  propagation_ = other.propagation_;
  process_.gnss_bias() = other.gnss_bias();
}

void Filter::predict(const ImuSample& imu, double dt, const inertial::ImuNoise& noise) {
  propagation_.add(state_.x, imu, dt, noise);
  process_.decay(state_, dt);
  if (propagation_.duration() >= process_.covariance_interval() - 1e-9) flush();
}

inertial::ErrorTransition Filter::transition() const {
  const Mean& x = state_.x;
  inertial::Earth here = earth();
  return propagation_.transition(x.nav, state_.p_ref, here.gravity(x.nav.position));
}

ProcessModel::Diagonal Filter::diagonal() const {
  return process_.over(propagation_.duration(), state_, earth().anchored());
}

void Filter::flush() {
  const double T = propagation_.duration();
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
  const ProcessModel::Diagonal d = diagonal();
  steps_.move(state_, step.F, d.decay, T);
  const int n = state_.size();
  Eigen::MatrixXd& P = state_.P();
  Eigen::Matrix<double, 9, Eigen::Dynamic, 0, 9, kMaxSize> rows(9, n);
  rows.noalias() = step.F.lazyProduct(P.topLeftCorner(kInertialSize, n));
  inertial::Matrix9d own = step.Q;
  own.noalias() += rows.leftCols<kInertialSize>().lazyProduct(step.F.transpose());
  if (state_.held()) state_.expected().head<9>() = (step.F * state_.expected().head<kInertialSize>()).eval();
  for (int k = kGnssBias; k < kReturnRate; ++k) {  // the only states that decay
    P.row(k).head(n) *= d.decay(k);
    P.col(k).head(n) *= d.decay(k);
    rows.col(k) *= d.decay(k);
  }
  if (state_.gnss_returns()) {
    const Eigen::Vector3d by_rate = ProcessModel::by_return_rate(state_.x, T);
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
  if (state_.has_camera()) {
    const double decay = inertial::gauss_markov_decay(T * state_.x.nav.velocity.norm(), tuning_.drift_way);
    state_.decay_track_drift(decay, (1.0 - decay * decay) * tuning_.drift * tuning_.drift);
  }
  propagation_.restart_sums();
}

template <int Rows>
Eigen::Matrix<double, Rows, kWithoutCamera> Filter::at_epoch(const Measurement<Rows>& m) const {
  Eigen::Matrix<double, Rows, kWithoutCamera> H = m.H;
  const double T = propagation_.duration();
  if (T <= 0.0) return H;
  H.template leftCols<9>().setZero();
  H = H * diagonal().decay.asDiagonal();
  H.template leftCols<kInertialSize>() += m.H.template leftCols<9>() * transition().F;
  if (state_.gnss_returns())
    H.col(kReturnRate) += m.H.template middleCols<3>(kGnssReturn) * ProcessModel::by_return_rate(state_.x, T);
  return H;
}

template <int Rows>
Eigen::Matrix<double, Rows, Rows> Filter::innovation_covariance(const Measurement<Rows>& m) const {
  const Eigen::Matrix<double, Rows, kWithoutCamera> H = at_epoch(m);
  Eigen::Matrix<double, Rows, Rows> S = m.R;
  if (const double T = propagation_.duration(); T > 0.0) {  // as if the covariance had been moved
    const Eigen::Matrix<double, Rows, 9> moved = m.H.template leftCols<9>();
    S += moved * transition().Q * moved.transpose();
    S += m.H * diagonal().noise.asDiagonal() * m.H.transpose();
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
  if (!innovation.usable || !m.shows_steps) return;
  steps_.begin_at_surprise(state_, motion(), innovation.nis, Rows);
  steps_.reject<Rows>(state_, at_epoch(m), innovation.L, innovation.whitened, m.shows_antenna);
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
  if (evidence) steps_.begin_at_surprise(state_, motion(), innovation.nis, Rows);
  steps_.use<Rows>(state_, m.H, innovation.L, innovation.whitened, Y, evidence, m.shows_antenna);
  scratch_.head(n) = Y.lazyProduct(innovation.whitened);
  state_.correct(scratch_);
}

template <int Rows>
AidingRecord Filter::fuse(AidingSource source, int64_t t_us, const Measurement<Rows>& m, double gate) {
  if (state_.held()) flush();
  const AidingRecord record = judge(source, t_us, m, gate);
  // Of slow wheels a scale does not show, and the noise of speeds without a sign is rectified.
  const bool slow =
      source == AidingSource::kWheelSpeed && state_.x.nav.velocity.squaredNorm() < vehicle::kSlow * vehicle::kSlow;
  if (record.status == AidingStatus::kGated && !slow) reject(m);
  if (record.status != AidingStatus::kAccepted) return record;
  flush();
  apply(m, m.shows_steps && !slow);
  return record;
}

std::optional<StepDetector::Step> Filter::likely_step(double sigmas, bool displaced, bool receiver_waits) {
  std::optional<StepDetector::Step> step;
  if (steps_.take_fresh()) step = steps_.most_likely(sigmas, displaced, receiver_waits);
  if (!step) steps_.advance(state_, motion(), displaced);
  return step;
}

void Filter::take_back(const StepDetector::Step& step) {
  flush();
  steps_.take_back(step, state_, motion());
}

void Filter::widen(const BaseVector& d) {
  flush();
  state_.P().topLeftCorner<kWithoutCamera, kWithoutCamera>() +=
      (d.head<kWithoutCamera>() * d.head<kWithoutCamera>().transpose()).eval();
}

void Filter::tie_frame(const inertial::Earth& to, double yaw, double yaw_std, const Eigen::Vector3d& local_place,
                       const Eigen::Vector3d& place, double place_std) {
  flush();
  const Eigen::Quaterniond turn = exp_q({0.0, 0.0, yaw});
  const Eigen::Vector3d gravity_before = earth().gravity(state_.x.nav.position);
  state_.change_frame(yaw, place - turn * local_place, yaw_std, place_std);
  propagation_.change_frame(turn, to);
  // Biases held what a local frame does not know of the Earth; how much of it is what their priors left.
  const Eigen::Matrix3d to_imu = state_.x.R().transpose();
  BaseVector unknown = BaseVector::Zero();
  unknown.segment<3>(kGyroBias) = to_imu * to.rate();
  widen(unknown);
  unknown.setZero();
  unknown.segment<3>(kAccelBias) = to_imu * (earth().gravity(state_.x.nav.position) - gravity_before);
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
    longest = std::max(longest, value - x.imu_offset + kChance * std::sqrt(std::max(variance, 0.0)));
  }
  if (state_.has_camera()) {
    const double sigma = std::sqrt(state_.P()(kCameraOffset, kCameraOffset));
    longest = std::max(longest, kChance * sigma - x.camera_offset);
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
