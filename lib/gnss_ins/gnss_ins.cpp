#include "gnss_ins/gnss_ins.h"

#include <algorithm>
#include <cmath>

#include "geometry/frames.h"

namespace roadfix {

namespace {

constexpr double kMaxLag = 1.5;         // s behind the horizon, for receivers that stamp late
constexpr double kBridgeAccel = 2.0;    // m/s2, what a car may do unseen in a gap of the IMU
constexpr double kSideslipShown = 3.0;  // s since the last position, to learn the car's sideslip
constexpr int64_t kDueEarly = 20'000;   // us, so that an interval of whole wheel periods is not missed by jitter
constexpr double kWheelsSilent = 0.3;   // s without a wheel speed, after which the constraint keeps its own time
constexpr double kBridgeRate = 0.2;     // rad/s
constexpr double kClipTime = 1.0;       // s that a turn beyond the gyro's range lasts

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
      no_use_(1e3),
      monitor_(config),
      screen_(config.screen),
      bank_(config),
      lag_us_(lag_of(prior_age(config.vehicle))) {
  no_gates_.nis.fill(1e12);
  no_use_.nis.fill(-1.0);
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

void GnssIns::note(AidingRecord record, int64_t id) {
  record.id = id;
  if (record.status == AidingStatus::kAccepted || record.status == AidingStatus::kReset) {
    used_at_us_[static_cast<size_t>(record.source)] = record.t_us;
    forward_stale_ = true;
  }
  if (records_.size() < records_.capacity()) records_.push_back(record);
}

void GnssIns::forget_before(int64_t t_us) {
  constexpr std::array kSources = {AidingSource::kGnssPosition, AidingSource::kGnssVelocity, AidingSource::kGnssHeading,
                                   AidingSource::kWheelSpeed, AidingSource::kMagHeading};  // by PendingKind
  pending_.drop_before(t_us, [&](const Pending& p) {
    AidingRecord r;
    r.t_us = p.t_us;
    r.source = kSources[static_cast<size_t>(p.kind)];
    note(r, p.id);
  });
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
  if (first_step_us_ == 0) first_step_us_ = imu.t_us;
  if (dt <= 0.0) return;
  const PropagationConfig& c = config_.propagation;
  const bool gap = dt > c.max_gap;
  const bool block_done = !gap && monitor_.add(imu, dt);
  const ImuNoise noise = noise_over(dt);
  if (gap) {
    ++gaps_;
    // What was measured inside the gap is of a time that the state skips.
    forget_before(imu.t_us - static_cast<int64_t>(1e6 * c.max_gap));
  }
  // After such a time the filter has no right against the receiver.
  if (gap || monitor_.frozen() || monitor_.gyro_clipped()) agreed_since_us_ = 0;
  // While moving: a turn that nobody saw must fit into one of the start's hypotheses, or all are asked again.
  const bool turned = kBridgeRate * dt > config_.alignment.heading_std_deg * kDegree;
  if (dt > c.realign_gap || (turned && moved_meanwhile(dt))) align_again();
  if (phase_ == AlignmentPhase::kDone) {
    core_->predict(imu, dt, noise);
    step_aligned(imu, block_done);
    if (block_done) lag_us_ = lag_of(core_->longest_age(wheels_at_us_ != 0));
  } else if (phase_ == AlignmentPhase::kHeading) {
    step_heading(imu, dt, noise, block_done);
  } else {
    phase_ = fix_ ? AlignmentPhase::kLevelling : AlignmentPhase::kWaiting;
    if (block_done && fix_) try_start(imu);
    if (block_done && !fix_) try_parked(imu);
  }
}

void GnssIns::align_again() {
  if (usable()) abandoned_ = SE3{core()->state().q_enu_imu, core()->state().position};
  phase_ = AlignmentPhase::kWaiting;
  core_.reset();
  bank_.stop();
  pending_.clear();
  refused_ = 0;
  if (recalled_) recalled_->parked = false;  // what was remembered of the place did not hold
  unseen_ = false;
  agreed_since_us_ = 0;
  jump_ = JumpJudge();
  refused_wheels_ = RefusedWheels();
  imu_doubt_ = ImuDoubt();
  lasting_watch_.begin_anew();
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
    const Beside beside = shown ? Beside::kFixes : Beside::kNothing;
    if (due(next_sideslip_us_, imu.t_us, config_.aiding.sideslip_interval))
      note(applier_.sideslip(core, gates_, beside), 0);
    if (due(next_heave_us_, imu.t_us, config_.aiding.heave_interval)) note(applier_.heave(core, gates_, beside), 0);
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

}  // namespace roadfix
