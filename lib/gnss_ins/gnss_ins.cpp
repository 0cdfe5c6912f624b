#include "gnss_ins/gnss_ins.h"

#include <algorithm>
#include <cmath>

#include "geometry/frames.h"

namespace roadfix {

namespace {

constexpr double kMaxLag = 1.5;          // s behind the horizon, for receivers that stamp late
constexpr double kBridgeAccel = 2.0;     // m/s2, what a car may do unseen in a gap of the IMU
constexpr double kSideslipShown = 3.0;   // s since the last position, to learn the car's sideslip
constexpr int64_t kDueEarly = 20'000;    // us, so that an interval of whole wheel periods is not missed by jitter
constexpr double kWheelsSilent = 0.3;    // s without a wheel speed, after which the constraint keeps its own time
constexpr double kBridgeRate = 0.2;      // rad/s
constexpr double kBlindTurn = 0.5;       // s of a gap while moving, after which the heading may be anything
constexpr double kClipTime = 1.0;        // s that a turn beyond the gyro's range lasts
constexpr double kMoving = 1.0;          // m/s
constexpr double kFixSpacing = 0.5;      // s, at least, between the two fixes that a start takes a velocity from
constexpr double kRecoveryHolds = 60.0;  // s; refused again within, the attitude is wrong as well

bool plausible(const ImuSample& s, const PropagationConfig& c) {
  return s.gyro.allFinite() && s.accel.allFinite() && s.gyro.norm() < c.max_gyro && s.accel.norm() < c.max_accel;
}

// The state stays behind the horizon by the longest latency that is possible yet.
int64_t lag_of(double age_s) { return static_cast<int64_t>(1e6 * std::clamp(age_s, 0.0, kMaxLag)); }

double prior_age(const GnssInsVehicle& v) {
  const TimePriors time(v);
  return 3.0 * std::hypot(std::max(time.position_latency, time.velocity_latency), time.imu_offset);
}

}  // namespace

GnssIns::GnssIns(const GnssInsConfig& config)
    : config_(config),
      applier_(config),
      gates_(config.aiding.gate_sigma),
      no_gates_(1e3),
      monitor_(config),
      screen_(config.screen),
      bank_(config),
      lag_us_(lag_of(prior_age(config.vehicle))) {
  no_gates_.nis.fill(1e12);
  records_.reserve(1024);
}

InputStatus GnssIns::see(const ImuSample& imu) {
  if (!plausible(imu, config_.propagation)) {
    ++bad_imu_;
    return InputStatus::kBadInput;
  }
  const int64_t newest = ring_.empty() ? last_step_us_ : ring_.back().t_us;
  if (imu.t_us <= newest) return InputStatus::kOutOfOrder;
  ring_.push(imu);
  return InputStatus::kAccepted;
}

InputStatus GnssIns::advance(const ImuSample& imu) {
  InputStatus status = InputStatus::kAccepted;
  const int64_t newest = ring_.empty() ? last_step_us_ : ring_.back().t_us;
  if (imu.t_us > newest) status = see(imu);
  while (!ring_.empty() && ring_.front().t_us <= imu.t_us - lag_us_) {
    step(ring_.front());
    ring_.pop();
  }
  return status;
}

void GnssIns::add(const GnssFix& fix, int64_t id) {
  const bool again = fix_ && fix.t_us == fix_->t_us && fix.antenna.latitude == fix_->antenna.latitude &&
                     fix.antenna.longitude == fix_->antenna.longitude && fix.antenna.height == fix_->antenna.height;
  const AidingStatus screened = again ? AidingStatus::kBadInput : screen_.check(fix);
  if (screened != AidingStatus::kAccepted) {
    AidingRecord r;
    r.t_us = fix.t_us;
    r.status = screened;
    note(r, id);
    return;
  }
  if (!anchor_) {
    anchor_ = fix.antenna;
    enu_.emplace(fix.antenna);
  }
  remember(fix);
  const Eigen::Matrix3d to_enu = enu_->R_anchor_enu_at(fix.antenna);
  const AidingConfig& a = config_.aiding;
  const auto floored = [&](Eigen::Matrix3d cov, double floor) {
    for (int i = 0; i < 3; ++i) cov(i, i) = std::max(cov(i, i), floor * floor);
    return Eigen::Matrix3d(to_enu * cov * to_enu.transpose());
  };
  Pending p;
  p.t_us = fix.t_us;
  p.id = id;
  p.value = enu_->enu(fix.antenna);
  p.cov = floored(fix.cov_enu, a.position_floor);
  pending_.push(p);
  if (fix.velocity && a.use_gnss_velocity) {
    p.kind = PendingKind::kVelocity;
    p.value = to_enu * fix.velocity->enu;
    const bool given = fix.velocity->cov_enu.diagonal().minCoeff() > 0.0;
    p.cov = floored(fix.velocity->cov_enu, given ? a.velocity_floor : a.velocity_default);
    pending_.push(p);
  }
  if (fix.heading && std::isfinite(fix.heading->heading)) {
    p.kind = PendingKind::kHeading;
    const double yaw = 0.5 * kPi - fix.heading->heading;
    const Eigen::Vector3d direction = to_enu * Eigen::Vector3d(std::cos(yaw), std::sin(yaw), 0.0);
    p.value = Eigen::Vector3d(std::atan2(direction.y(), direction.x()), 0.0, 0.0);
    const double sigma = std::max(fix.heading->sigma, a.heading_floor * kDegree);
    p.cov = sigma * sigma * Eigen::Matrix3d::Identity();
    pending_.push(p);
  }
}

void GnssIns::remember(const GnssFix& fix) {
  // A fast receiver's neighbouring fixes are too close for a velocity: the older one stays for twice the least spacing.
  if (fix_ && (!fix_before_ || seconds_between(fix_before_->t_us, fix.t_us) >= 2.0 * kFixSpacing))
    fix_before_ = seconds_between(fix_->t_us, fix.t_us) >= kFixSpacing ? fix_ : fix;
  fix_ = fix;
}

void GnssIns::add(const WheelSample& wheels, int64_t id) {
  if (!config_.aiding.use_wheels) return;
  Pending p;
  p.kind = PendingKind::kWheels;
  p.t_us = wheels.t_us;
  p.id = id;
  p.direction = wheels.direction;
  // Four speeds: the rear axle's mean is the speed of its centre, with half the variance of one wheel.
  const bool four = wheels.num_speeds == 4;
  p.value.x() = four ? 0.5 * (wheels.speeds[2] + wheels.speeds[3]) : wheels.speeds[0];
  p.cov(0, 0) = config_.vehicle.wheel_noise * config_.vehicle.wheel_noise * (four ? 0.5 : 1.0);
  if (!std::isfinite(p.value.x()) || std::abs(p.value.x()) > 100.0) {
    AidingRecord r;
    r.t_us = wheels.t_us;
    r.source = AidingSource::kWheelSpeed;
    r.status = AidingStatus::kBadInput;
    note(r, id);
    return;
  }
  if (seconds_between(last_wheel_us_, wheels.t_us) < config_.aiding.wheel_interval - 0.005) return;
  last_wheel_us_ = wheels.t_us;
  pending_.push(p);
}

void GnssIns::add(const MagSample& mag, int64_t id) {
  if (!config_.aiding.use_mag || !mag.field.allFinite()) return;
  if (seconds_between(last_mag_us_, mag.t_us) < config_.aiding.mag_interval) return;
  last_mag_us_ = mag.t_us;
  Pending p;
  p.kind = PendingKind::kMag;
  p.t_us = mag.t_us;
  p.id = id;
  p.value = config_.vehicle.soft_iron * (mag.field - config_.vehicle.hard_iron);
  if (p.value.norm() <= 0.0) return;
  pending_.push(p);
}

void GnssIns::note(AidingRecord record, int64_t id) {
  record.id = id;
  if (record.status == AidingStatus::kAccepted || record.status == AidingStatus::kReset)
    used_at_us_[static_cast<size_t>(record.source)] = record.t_us;
  forward_stale_ = true;
  if (records_.size() < records_.capacity()) records_.push_back(record);
}

ImuNoise GnssIns::noise_over(double dt) const {
  ImuNoise noise = monitor_.noise();
  // White noise that over this time does what an unseen manoeuvre may do, (M.18).
  if (dt > config_.propagation.max_gap || monitor_.frozen())
    noise = {kBridgeRate * std::sqrt(dt), kBridgeAccel * std::sqrt(dt)};
  if (monitor_.gyro_clipped()) noise.gyro = kBridgeRate * std::sqrt(kClipTime);
  return noise;
}

void GnssIns::step(const ImuSample& imu) {
  const double dt = last_step_us_ == 0 ? 0.0 : seconds_between(last_step_us_, imu.t_us);
  last_step_us_ = imu.t_us;
  if (dt <= 0.0) return;
  const PropagationConfig& c = config_.propagation;
  const bool gap = dt > c.max_gap;
  const bool block_done = !gap && monitor_.add(imu, dt);
  const ImuNoise noise = noise_over(dt);
  if (gap) {
    ++gaps_;
    // What was measured inside the gap is of a time that the state skips.
    pending_.drop_before(imu.t_us - static_cast<int64_t>(1e6 * c.max_gap));
  }
  if (dt > c.realign_gap || (dt > kBlindTurn && moved_meanwhile(dt))) align_again();
  if (phase_ == AlignmentPhase::kDone) {
    core_->predict(imu, dt, noise);
    step_aligned(imu, block_done);
    if (block_done) lag_us_ = lag_of(core_->longest_age());
  } else if (phase_ == AlignmentPhase::kHeading) {
    step_heading(imu, dt, noise, block_done);
  } else {
    phase_ = fix_ ? AlignmentPhase::kLevelling : AlignmentPhase::kWaiting;
    if (block_done && fix_) try_start(imu);
  }
}

bool GnssIns::moved_meanwhile(double dt) const {
  if (core() == nullptr) return false;
  const NavState& before = core()->state();
  if (before.velocity.norm() > kMoving) return true;
  if (!fix_ || fix_->t_us <= before.t_us) return false;
  const Eigen::Vector3d way =
      enu_->enu(fix_->antenna) - before.position - before.q_enu_imu * config_.vehicle.p_imu_antenna;
  return way.head<2>().norm() > kMoving * dt + 3.0 * std::sqrt(fix_->cov_enu(0, 0) + fix_->cov_enu(1, 1));
}

void GnssIns::align_again() {
  phase_ = AlignmentPhase::kWaiting;
  core_.reset();
  bank_.stop();
  pending_.clear();
  refused_ = 0;
  agreed_since_us_ = 0;
  jump_ = JumpJudge();
  forward_stale_ = true;
  lag_us_ = lag_of(prior_age(config_.vehicle));
}

void GnssIns::step_aligned(const ImuSample& imu, bool block_done) {
  InsCore& core = *core_;
  bool wheels = false;
  pending_.take_due([&]() -> const NavState& { return core.state(); },
                    [&](const Pending& p) {
                      wheels = wheels || p.kind == PendingKind::kWheels;
                      use(p);
                    });
  if (lost_) {
    lost_ = false;
    return align_again();
  }
  if (wheels) wheels_at_us_ = imu.t_us;
  // Where wheel speeds come, the constraint joins them: one epoch of updates instead of two.
  if (wheels || seconds_between(wheels_at_us_, imu.t_us) > kWheelsSilent) {
    const bool shown = seconds_between(used_at_us_[0], imu.t_us) < kSideslipShown;
    if (due(next_sideslip_us_, imu.t_us, config_.aiding.sideslip_interval))
      note(applier_.sideslip(core, gates_, shown), 0);
    if (due(next_heave_us_, imu.t_us, config_.aiding.heave_interval)) note(applier_.heave(core, gates_, shown), 0);
  }
  if (block_done && standing_now(core)) {
    note(applier_.standing_velocity(core, gates_), 0);
    note(applier_.standing_rate(core, monitor_.block(), gates_), 0);
  }
}

bool GnssIns::due(int64_t& next_us, int64_t t_us, double interval) const {
  if (!config_.aiding.use_sideslip || t_us < next_us) return false;
  next_us = t_us + static_cast<int64_t>(1e6 * interval) - kDueEarly;
  return true;
}

void GnssIns::use(const Pending& measured) {
  Pending p = measured;
  if (p.kind == PendingKind::kPosition) {
    p.cov *= position_noise_.variance_factor();
    use_position(p);
  } else if (p.kind == PendingKind::kVelocity) {
    p.cov *= velocity_noise_.variance_factor();
    const AidingRecord r = applier_.apply(*core_, p, gates_);
    velocity_noise_.learn(r);
    note(r, p.id);
  } else if (p.kind == PendingKind::kMag && core_->heading_std() < config_.aiding.mag_std) {
    // Its errors do not average out: once the heading is better than the magnetometer, it only harms.
    AidingRecord r;
    r.t_us = p.t_us;
    r.source = AidingSource::kMagHeading;
    r.status = AidingStatus::kDisabled;
    note(r, p.id);
  } else {
    note(applier_.apply(*core_, p, gates_), p.id);
  }
}

void GnssIns::use_position(const Pending& p) {
  AidingRecord r = applier_.apply(*core_, p, gates_);
  const bool jumped = jump_.judge(r, config_.aiding.gate_sigma);
  // A jump says nothing of the noise.
  if (!jumped) position_noise_.learn(r);
  if (r.status == AidingStatus::kGated) {
    const AidingRecord level = applier_.apply_level(*core_, p, gates_);
    if (level.status == AidingStatus::kAccepted) r = level;
  }
  if (r.status == AidingStatus::kAccepted) {
    if (agreed_since_us_ == 0) agreed_since_us_ = p.t_us;
    refused_ = 0;
  } else {
    if (refused_++ == 0) refused_since_us_ = p.t_us;
    const AlignmentConfig& a = config_.alignment;
    // The receiver that jumped is held against the filter as long as they agreed before.
    const double agreed = agreed_since_us_ == 0 ? 0.0 : seconds_between(agreed_since_us_, refused_since_us_);
    const double patience = jumped ? std::clamp(agreed, a.recovery_s, std::max(a.recovery_s, a.jump_s)) : a.recovery_s;
    if (refused_ >= a.recovery_fixes && seconds_between(refused_since_us_, p.t_us) >= patience) {
      // Position and velocity were taken from the fixes and do not hold: the heading must be wrong.
      lost_ = recovered_at_us_ != 0 && seconds_between(recovered_at_us_, p.t_us) < kRecoveryHolds;
      recovered_at_us_ = p.t_us;
      agreed_since_us_ = 0;
      recover(p);
      r.status = AidingStatus::kReset;
    }
  }
  note(r, p.id);
}

void GnssIns::recover(const Pending& p) {
  const NavState before = core_->state();
  ErrorMatrix P = core_->covariance();
  // The filter's position and velocity are given up; attitude and biases are kept, with room to be wrong.
  P.middleRows<6>(kPos).setZero();
  P.middleCols<6>(kPos).setZero();
  P.diagonal().segment<3>(kPos).setConstant(1e4);
  P.diagonal().segment<3>(kVel).setConstant(4.0);
  P.diagonal().segment<3>(kAtt) += Eigen::Vector3d(1e-4, 1e-4, 3e-3);
  core_->initialise(before, P);
  (void)applier_.apply(*core_, p, no_gates_);
  const NavState& after = core_->state();
  ++reset_counter_;
  reset_delta_.p = after.position - before.position;
  reset_delta_.q = before.q_enu_imu.conjugate() * after.q_enu_imu;
  refused_ = 0;
  jump_ = JumpJudge();
}

}  // namespace roadfix
