// Positions and the rest that waited, once the state has reached them; who is believed when filter and receiver differ.
#include <algorithm>
#include <cmath>

#include "gnss_ins/gnss_ins.h"

namespace roadfix {

namespace {

constexpr double kMoving = 1.0;          // m/s
constexpr double kRecoveryHolds = 60.0;  // s; refused again within, the attitude is wrong as well
constexpr double kConfirmed = 1.0;       // s since another source last agreed with the filter's velocity
// rad2, what an attitude may be wrong by where fixes are refused: 0.6 degrees of tilt and 3 of heading, which shows
// late.
const Eigen::Vector3d kTurnedAway(1e-4, 1e-4, 3e-3);
constexpr double kUnnoticed = 3.0;  // s, that a bias acts until fixes of centimetres are refused for it
constexpr double kGravity = 9.8;    // m/s2
// Correlation time of the errors of fixes without a fixed carrier phase, until they have shown theirs: multipath and
// code smoothing last seconds to a minute (Misra and Enge, Global Positioning System, 2006, ch. 5).
constexpr double kCodeAlike = 5.0;  // s
// m, level: how far off a receiver may come back at least (twice that in height), and at most as far as the fix is off.
constexpr double kReturnLeast = 3.0;
constexpr double kReturnMost = 10.0;
// A return error below this share of a fix's sigma no longer counts.
constexpr double kReturnOver = 0.1;

}  // namespace

void GnssIns::use(const Pending& measured) {
  Pending p = measured;
  if (p.kind == PendingKind::kPosition) {
    use_position(p);
  } else if (p.kind == PendingKind::kVelocity) {
    weigh(p);
    const AidingRecord r = applier_.apply(*core_, p, gates_);
    velocity_noise_.learn(r);
    note(r, p.id);
    if (p.fix_type == FixType::kRtkFixed) tell_imu_doubt(p, r);
  } else if (p.kind == PendingKind::kMag && core_->heading_std() < config_.aiding.mag_std) {
    // Its errors do not average out: once the heading is better than the magnetometer, it only harms.
    AidingRecord r;
    r.t_us = p.t_us;
    r.source = AidingSource::kMagHeading;
    r.status = AidingStatus::kDisabled;
    note(r, p.id);
  } else {
    AidingRecord r = applier_.apply(*core_, p, gates_);
    if (p.kind == PendingKind::kWheels) use_wheels(p, r);
    note(r, p.id);
  }
}

/// The biases may be any that the calibration knows of; what they did since a position agreed, and before it showed, is
/// in velocity and attitude, (M.46).
void GnssIns::doubt_imu(const Pending& p, const Eigen::Vector3d& off) {
  const double gyro = config_.vehicle.gyro_bias_std, accel = config_.vehicle.accel_bias_std;
  const double dt = kUnnoticed + imu_doubt_.since(p.t_us);
  ErrorMatrix P = core_->covariance();
  P.diagonal().segment<3>(kGyroBias).array() += gyro * gyro;
  P.diagonal().segment<3>(kAccelBias).array() += accel * accel;
  P.diagonal().segment<3>(kAtt) += kTurnedAway;
  const double tilted = 0.5 * kGravity * gyro * dt;
  P.diagonal().segment<3>(kVel).array() += (accel * accel + tilted * tilted) * dt * dt;
  P.block<3, 3>(kPos, kPos) += off * off.transpose();
  core_->replace_covariance(P);
}

bool GnssIns::agrees_with(AidingSource source, int64_t t_us) const {
  const int64_t at = used_at_us_[static_cast<size_t>(source)];
  return at != 0 && seconds_between(at, t_us) < kConfirmed;
}

void GnssIns::use_position(const Pending& measured) {
  Pending p = measured;
  PositionQuality& quality = position_quality_[static_cast<size_t>(p.fix_type)];
  const double since = seconds_between(position_at_us_, p.t_us);
  if (position_at_us_ == 0 || since > kOutage) {
    show_anew();
    if (returns(p.fix_type)) begin_return(p);
  } else if (since > 0.0) {
    fix_interval_ = since;
  }
  position_at_us_ = p.t_us;
  const bool doubted = quality.noise.doubted();
  if (doubted) weigh_by_itself(p, quality.noise);
  weigh(p);

  const LastingShare lasting = lasting_of(p.fix_type);
  const Eigen::Vector3d displaced = core_->displacement();
  AidingRecord r = try_position(p, lasting);
  if (r.status == AidingStatus::kGated && applier_.agrees_undisplaced(*core_, p, gates_)) {
    begin_return(p);  // it has jumped back
    r = applier_.apply(*core_, p, gates_);
  }
  const double sigma = std::sqrt(p.cov(0, 0) + p.cov(1, 1));
  if (core_->fix_error().returning() && core_->fix_error().return_size() < kReturnOver * sigma) core_->end_return();
  // A jump, or a receiver that is dragged away from what wheels or its own velocity say, tells nothing of the noise.
  const bool jumped = jump_.judge(r, config_.aiding.gate_sigma);
  const bool heading_holds = agrees_with(AidingSource::kGnssVelocity, p.t_us);
  const bool dragged = jump_.one_sided() && (heading_holds || agrees_with(AidingSource::kWheelSpeed, p.t_us));
  if (r.status == AidingStatus::kAccepted) {
    imu_doubt_.agreed(p);
  } else if (r.status == AidingStatus::kGated && p.fix_type == FixType::kRtkFixed) {
    const Eigen::Vector3d off = Eigen::Map<const Eigen::Vector3d>(r.innovation.data());
    if (imu_doubt_.refused(p, off, config_.aiding.gate_sigma)) {
      doubt_imu(p, off);
      r = applier_.apply(*core_, p, gates_);
    }
  }
  if (!jumped && !dragged && !(doubted && r.status == AidingStatus::kAccepted)) quality.noise.learn(r);
  if (r.status == AidingStatus::kGated) {
    const AidingRecord level = applier_.apply_level(*core_, p, gates_);
    if (level.status == AidingStatus::kAccepted) {
      r = level;
      refuse_height(p);
    }
  } else if (r.status == AidingStatus::kAccepted) {
    height_refused_since_us_ = 0;
  }
  if (lasting.share > 0.0 && r.status == AidingStatus::kAccepted)
    watch_lasting(measured, p, Eigen::Map<const Eigen::Vector3d>(r.innovation.data()) + displaced);
  else if (lasting.share == 0.0)
    lasting_watch_.begin_anew();
  quality.correlation.learn(r, p.cov.diagonal(), p.alike);
  if (r.status == AidingStatus::kAccepted) {
    if (agreed_since_us_ == 0) agreed_since_us_ = p.t_us;
    refused_ = 0;
    unseen_ = false;
  } else {
    if (refused_++ == 0) refused_since_us_ = p.t_us;
    const AlignmentConfig& a = config_.alignment;
    // The receiver that jumped or is dragged is held against the filter as long as they agreed before.
    const double agreed = agreed_since_us_ == 0 ? 0.0 : seconds_between(agreed_since_us_, refused_since_us_);
    const double patience =
        jumped || dragged ? std::clamp(agreed, a.recovery_s, std::max(a.recovery_s, a.jump_s)) : a.recovery_s;
    if (refused_ >= a.recovery_fixes && seconds_between(refused_since_us_, p.t_us) >= patience) {
      // Position and velocity were taken from the fixes and do not hold: the heading must be wrong.
      // Wheels do not tell: their speed is right on a wrong heading as well.
      lost_ = !heading_holds && recovered_at_us_ != 0 && seconds_between(recovered_at_us_, p.t_us) < kRecoveryHolds;
      recovered_at_us_ = p.t_us;
      agreed_since_us_ = 0;
      if (!lost_) recover(p);
      r.status = AidingStatus::kReset;
    }
  }
  note(r, p.id);
}

/// A fixed carrier phase was checked against its neighbours before it was called so.
bool GnssIns::returns(FixType type) const {
  return position_at_us_ != 0 && config_.aiding.use_return_error && type != FixType::kRtkFixed;
}

/// After an outage what the receiver has shown tells little of it.
void GnssIns::show_anew() {
  lasting_watch_.begin_anew();
  for (size_t type = 0; type < position_quality_.size(); ++type) {
    PositionQuality& quality = position_quality_[type];
    const bool alike = type != static_cast<size_t>(FixType::kRtkFixed);
    quality.correlation.assume(alike ? std::exp(-fix_interval_ / kCodeAlike) : 0.0);
    if (position_at_us_ != 0 && config_.aiding.use_return_error) quality.noise.begin_anew();
  }
}

/// As its kind has shown itself.
void GnssIns::weigh(Pending& p) const {
  if (p.kind == PendingKind::kVelocity) p.cov *= velocity_noise_.variance_factor();
  if (p.kind != PendingKind::kPosition) return;
  const PositionQuality& quality = position_quality_[static_cast<size_t>(p.fix_type)];
  p.cov *= quality.noise.variance_factor();
  if (config_.aiding.use_error_correlation) p.alike = quality.correlation.inflation();
}

/// The first fix tells how large the error may be: what the filter's own uncertainty does not explain of it.
void GnssIns::begin_return(const Pending& p) {
  core_->end_return();
  const AidingRecord r = applier_.apply(*core_, p, no_use_);
  double excess = 0.0;
  for (size_t i = 0; i < 2; ++i) excess += 0.5 * (r.innovation[i] * r.innovation[i] - r.innovation_variance[i]);
  core_->begin_return(return_sigmas(std::sqrt(std::max(excess, 0.0))));
}

Eigen::Vector3d GnssIns::return_sigmas(double level) {
  const double sigma = std::clamp(level, kReturnLeast, kReturnMost);
  return {sigma, sigma, 2.0 * sigma};
}

/// The fix teaches the noise before it is used, (M.37). What the gate refuses teaches nothing.
void GnssIns::weigh_by_itself(const Pending& measured, NoiseScale& noise) {
  Pending p = measured;
  p.cov *= noise.variance_factor();
  AidingRecord tried = applier_.apply(*core_, p, no_use_);
  if (tried.status != AidingStatus::kGated || tried.nis > gates_.nis[3]) return;
  tried.status = AidingStatus::kAccepted;
  noise.learn(tried);
}

void GnssIns::recover(const Pending& p) {
  const NavState before = core_->state();
  ErrorMatrix P = core_->covariance();
  // The filter's position and velocity are given up; attitude and biases are kept, with room to be wrong.
  P.middleRows<6>(kPos).setZero();
  P.middleCols<6>(kPos).setZero();
  P.diagonal().segment<3>(kPos).setConstant(1e4);
  P.diagonal().segment<3>(kVel).setConstant(4.0);
  P.diagonal().segment<3>(kAtt) += kTurnedAway;
  P.diagonal().segment<3>(kGyroBias).array() += config_.vehicle.gyro_bias_std * config_.vehicle.gyro_bias_std;
  P.diagonal().segment<3>(kAccelBias).array() += config_.vehicle.accel_bias_std * config_.vehicle.accel_bias_std;
  core_->initialise(before, P);
  lasting_watch_.begin_anew();
  (void)applier_.apply(*core_, p, no_gates_);
  const NavState& after = core_->state();
  ++reset_counter_;
  reset_delta_.p = after.position - before.position;
  reset_delta_.q = before.q_enu_imu.conjugate() * after.q_enu_imu;
  refused_ = 0;
  jump_ = JumpJudge();
}

/// The height alone contradicts: a receiver that counts from another surface, or a filter that began on it. As nobody
/// else knows heights, the receiver is right in the end.
void GnssIns::refuse_height(const Pending& p) {
  if (height_refused_since_us_ == 0) height_refused_since_us_ = p.t_us;
  if (seconds_between(height_refused_since_us_, p.t_us) < config_.alignment.jump_s) return;
  const NavState before = core_->state();
  ErrorMatrix P = core_->covariance();
  for (const auto& [index, variance] : {std::pair{kPos + 2, 1e4}, std::pair{kVel + 2, 4.0}}) {
    P.row(index).setZero();
    P.col(index).setZero();
    P(index, index) = variance;
  }
  core_->initialise(before, P);
  (void)applier_.apply_height(*core_, p, no_gates_);
  ++reset_counter_;
  reset_delta_ = {};
  reset_delta_.p = core_->state().position - before.position;
  reset_delta_.q = before.q_enu_imu.conjugate() * core_->state().q_enu_imu;
  height_refused_since_us_ = 0;
}

bool GnssIns::moved_meanwhile(double dt) const {
  if (core() == nullptr) return false;
  const NavState& before = core()->state();
  if (before.velocity.norm() > kMoving) return true;
  if (!fix_ || fix_->t_us <= before.t_us) return false;
  const Eigen::Vector3d way = enu_->enu(fix_->antenna) - before.position - before.q_enu_imu * before.p_imu_antenna;
  return way.head<2>().norm() > kMoving * dt + 3.0 * std::sqrt(fix_->cov_enu(0, 0) + fix_->cov_enu(1, 1));
}

}  // namespace roadfix
