// Alignment: from the first samples and fixes to one filter with a known heading.
#include <cmath>

#include "geodesy/gravity.h"
#include "geometry/euler.h"
#include "geometry/frames.h"
#include "geometry/so3.h"
#include "gnss_ins/gnss_ins.h"

namespace roadfix {

namespace {

constexpr double kFixMaxAge = 2.5;      // s, of a fix to start from
constexpr double kFixMaxSpacing = 3.0;  // s, between two fixes that give a velocity
constexpr double kFixMinSpacing = 0.5;  // s
constexpr double kStandingSpeed = 0.3;  // m/s
constexpr int kCalmBlocks = 6;          // in a row; of 5500 blocks of moving cars two at most were (E 16)
constexpr double kMayBeZero = 16.3;     // chi-square of a velocity that may be nought, three axes, 99.9 %
constexpr double kParkedSlack = 3.0;    // m, by which fixes may miss the place beyond their sigma (another bay is 2.5)
constexpr double kParkedPlace = 0.5;    // m, by which a parked car may have been rolled
constexpr double kParkedSigma = 10.0;   // m; a place known worse is not worth keeping
constexpr double kParkedTilt = 0.02;    // rad; more, and it stands elsewhere
constexpr double kNoFixWait = 5.0;      // s for a first fix, before a start without
constexpr double kCarAcceleration = 2.0;  // m/s2, by which a mean velocity may differ from the present one

struct StartVelocity {
  Eigen::Vector3d value;
  double std;
};

std::optional<StartVelocity> start_velocity(const EnuAnchor& enu, const GnssFix& fix,
                                            const std::optional<GnssFix>& before, const GnssInsConfig& c) {
  if (fix.velocity) {
    const double std = std::sqrt(
        std::max(fix.velocity->cov_enu.diagonal().maxCoeff(), c.aiding.velocity_default * c.aiding.velocity_default));
    const double late = std::hypot(c.vehicle.velocity_latency_std, c.vehicle.time_offset_std);
    return StartVelocity{fix.velocity->enu, std + kCarAcceleration * late};
  }
  if (!before) return std::nullopt;
  const double spacing = seconds_between(before->t_us, fix.t_us);
  if (spacing < kFixMinSpacing || spacing > kFixMaxSpacing) return std::nullopt;
  const double noise = std::sqrt(fix.cov_enu.diagonal().maxCoeff() + before->cov_enu.diagonal().maxCoeff());
  return StartVelocity{(enu.enu(fix.antenna) - enu.enu(before->antenna)) / spacing, noise / spacing};
}

}  // namespace

bool GnssIns::standing_now(const InsCore& core) const {
  if (!config_.aiding.use_zero_velocity || !monitor_.calm() || monitor_.frozen()) return false;
  const NavState& x = core.state();
  if ((monitor_.block().gyro - x.gyro_bias).norm() > 4e-3) return false;
  if (x.velocity.norm() < kStandingSpeed) return true;
  // A velocity that is hardly known says little; that nothing shakes for long says much, (M.53).
  if (monitor_.calm_blocks() < kCalmBlocks) return false;
  const Eigen::Matrix3d cov = core.covariance().block<3, 3>(kVel, kVel);
  return x.velocity.dot(cov.llt().solve(x.velocity)) < kMayBeZero;
}

void GnssIns::try_start(const ImuSample& imu) {
  const double age = seconds_between(fix_->t_us, imu.t_us);
  if (age > kFixMaxAge || age < -kFixMaxAge || monitor_.frozen()) return;
  const std::optional<StartVelocity> v = start_velocity(*enu_, *fix_, fix_before_, config_);
  if (!v) return;
  const ImuBlock& b = monitor_.block();
  const double g = normal_gravity_enu(*enu_, Eigen::Vector3d::Zero()).norm();
  StartState s;
  s.t_us = imu.t_us;
  s.standing = monitor_.calm() && v->value.norm() < kStandingSpeed &&
               std::abs(b.accel.norm() - g) < 0.1 + 4.0 * config_.vehicle.accel_bias_std;
  s.mean_gyro = b.gyro;
  s.mean_accel = b.accel;
  s.accel_std = s.standing ? config_.alignment.standing_accel_std : config_.alignment.moving_accel_std;
  s.velocity = s.standing ? Eigen::Vector3d::Zero() : v->value;
  // A velocity between fixes is that of their middle, half their spacing and the fix's age ago.
  const double since = std::abs(age) + (fix_->velocity ? 0.0 : 0.5 * seconds_between(fix_before_->t_us, fix_->t_us));
  s.velocity_std = s.standing ? config_.alignment.velocity_std_standing : v->std + kCarAcceleration * since;
  s.antenna = enu_->enu(fix_->antenna) + age * s.velocity;
  const double moved =
      s.velocity_std * std::abs(age) +
      s.velocity.norm() * std::hypot(config_.vehicle.position_latency_std, config_.vehicle.time_offset_std);
  s.fix_type = fix_->fix_type;
  s.fix_cov = fix_->cov_enu;
  if (position_at_us_ != 0 && resumed_us_ > position_at_us_) {
    show_anew();
    if (returns(s.fix_type)) s.returning = return_sigmas(0.0);
  }
  s.fix_cov *= position_quality_[static_cast<size_t>(s.fix_type)].noise.variance_factor();
  s.lasting = lasting_of(s.fix_type);
  s.antenna_cov = s.fix_cov + (moved * moved + 1e-4) * Eigen::Matrix3d::Identity();
  if (fix_->heading) {
    s.yaw = wrap_angle(0.5 * kPi - fix_->heading->heading - config_.vehicle.mounting.y());
    s.yaw_std =
        std::max(fix_->heading->sigma, config_.aiding.heading_floor * kDegree) + config_.vehicle.mounting_std.z();
  }
  if (recalled_ && recalled_->parked && s.standing && stands_as_parked(b)) {
    const Eigen::Vector3d parked = enu_->enu(recalled_->place) + recalled_->q_enu_imu * config_.vehicle.p_imu_antenna;
    const double sigma = std::sqrt(s.antenna_cov(0, 0) + s.antenna_cov(1, 1)) + recalled_->place_sigma;
    if ((s.antenna - parked).head<2>().norm() < kParkedSlack + 3.0 * sigma) s.parked_yaw = yaw_of(recalled_->q_enu_imu);
  }
  begin(s);
}

// In a garage: no fix, but it stands as it was parked.
void GnssIns::try_parked(const ImuSample& imu) {
  if (!recalled_ || !recalled_->parked || seconds_between(first_step_us_, imu.t_us) < kNoFixWait) return;
  const ImuBlock& b = monitor_.block();
  if (monitor_.frozen() || !monitor_.calm() || !stands_as_parked(b)) return;
  anchor_ = recalled_->place;
  enu_.emplace(*anchor_);
  StartState s;
  s.t_us = imu.t_us;
  s.standing = true;
  s.mean_gyro = b.gyro;
  s.mean_accel = b.accel;
  s.accel_std = config_.alignment.standing_accel_std;
  s.velocity_std = config_.alignment.velocity_std_standing;
  s.antenna = recalled_->q_enu_imu * config_.vehicle.p_imu_antenna;
  const double sigma = std::hypot(recalled_->place_sigma, kParkedPlace);
  s.antenna_cov = sigma * sigma * Eigen::Matrix3d::Identity();
  s.parked_yaw = yaw_of(recalled_->q_enu_imu);
  unseen_ = true;
  begin(s);
}

bool GnssIns::stands_as_parked(const ImuBlock& b) const {
  const Eigen::Vector3d bias = recalled_->value.segment<3>(kAccelBias - InsMemory::kFirst);
  const Eigen::Vector3d up = (b.accel - bias).normalized();
  const Eigen::Vector3d was = recalled_->q_enu_imu.conjugate() * Eigen::Vector3d::UnitZ();
  return up.cross(was).norm() < kParkedTilt;
}

void GnssIns::begin(StartState s) {
  s.memory = recalled_;
  // What is older made the start, or lies too far back to be carried over an unknown acceleration: fixes of the second
  // before, taken at this epoch as if the velocity had been constant, once turned a start by five degrees of pitch.
  forget_before(s.t_us + 1);
  bank_.start(*anchor_, s);
  forward_stale_ = true;
  phase_ = AlignmentPhase::kHeading;
}

void GnssIns::recall(const InsMemory& memory) {
  if (core() == nullptr && memory.sane()) recalled_ = memory;
}

std::optional<InsMemory> GnssIns::memory() const {
  if (phase_ != AlignmentPhase::kDone) return std::nullopt;
  const NavState& x = core_->state();
  const ErrorMatrix P = core_->covariance();
  InsMemory m = remembered(x, P);
  m.place = enu_->geodetic(x.position);
  m.q_enu_imu = normalized_positive(Eigen::Quaterniond(enu_->R_anchor_enu_at(m.place).transpose()) * x.q_enu_imu);
  m.place_sigma = std::sqrt(P(kPos, kPos) + P(kPos + 1, kPos + 1));
  m.heading_sigma = core_->heading_std();
  m.parked = standing_now(*core_) && m.heading_sigma < config_.alignment.confirm_std_deg * kDegree &&
             m.place_sigma < kParkedSigma;
  return m;
}

bool GnssIns::usable() const {
  if (phase_ != AlignmentPhase::kHeading) return phase_ == AlignmentPhase::kDone;
  return bank_.heading_std() <
         std::hypot(config_.alignment.confirm_std_deg * kDegree, config_.vehicle.mounting_std.z());
}

void GnssIns::count_new_alignment() {
  const NavState& x = core()->state();
  ++reset_counter_;
  reset_delta_.p = x.position - abandoned_->p;
  reset_delta_.q = abandoned_->q.conjugate() * x.q_enu_imu;
  abandoned_.reset();
}

void GnssIns::step_heading(const ImuSample& imu, double dt, const ImuNoise& noise, bool block_done) {
  bank_.predict(imu, dt, noise);
  const auto leader = [&]() -> const NavState& { return bank_.leader().state(); };
  pending_.take_due(leader, [&](const Pending& measured) {
    Pending p = measured;
    if (position_at_us_ != 0) weigh(p);  // as this drive has shown
    const LastingShare lasting = p.kind == PendingKind::kPosition ? lasting_of(p.fix_type) : LastingShare();
    const auto apply = [&](InsCore& core) {
      if (lasting.share > 0.0) core.expect_lasting(p.fix_type, lasting, p.cov.diagonal());
      return applier_.apply(core, p, no_gates_);
    };
    note(bank_.aid(apply), p.id);
  });
  if (due(next_sideslip_us_, imu.t_us, config_.aiding.sideslip_interval))
    note(bank_.aid([&](InsCore& core) { return applier_.sideslip(core, no_gates_, Beside::kSoughtHeading); }), 0);
  if (due(next_heave_us_, imu.t_us, config_.aiding.heave_interval))
    note(bank_.aid([&](InsCore& core) { return applier_.heave(core, no_gates_, Beside::kSoughtHeading); }), 0);
  if (block_done && standing_now(bank_.leader())) {
    note(bank_.aid([&](InsCore& core) { return applier_.standing_velocity(core, no_gates_); }), 0);
    note(bank_.aid([&](InsCore& core) { return applier_.standing_rate(core, monitor_.block(), no_gates_); }), 0);
  }
  if (abandoned_ && usable()) count_new_alignment();
  if (!block_done || !bank_.confirmed()) return;
  core_.emplace(bank_.leader());
  if (config_.aiding.use_scale_steps && config_.vehicle.wheel_scale_std > 0.0) core_->follow_scale_steps();
  core_->consider({});
  bank_.stop();
  phase_ = AlignmentPhase::kDone;
  forward_stale_ = true;
  if (abandoned_) count_new_alignment();
}

}  // namespace roadfix
