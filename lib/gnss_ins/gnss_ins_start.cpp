// Alignment: from the first samples and fixes to one filter with a known heading.
#include <cmath>

#include "geodesy/gravity.h"
#include "geometry/frames.h"
#include "gnss_ins/gnss_ins.h"

namespace roadfix {

namespace {

constexpr double kFixMaxAge = 2.5;        // s, of a fix to start from
constexpr double kFixMaxSpacing = 3.0;    // s, between two fixes that give a velocity
constexpr double kFixMinSpacing = 0.5;    // s
constexpr double kStandingSpeed = 0.3;    // m/s
constexpr double kCarAcceleration = 2.0;  // m/s2, by which a mean velocity may differ from the present one

struct StartVelocity {
  Eigen::Vector3d value;
  double std;
};

// Calm enough to stand: no quarter of the block differs from it by more than noise and engine shake give.
bool calm(const ImuBlock& b, const ImuNoise& noise) {
  const double quarter = std::sqrt(b.duration / 4.0);
  return b.gyro_wander < 2e-3 + 3.0 * noise.gyro / quarter && b.accel_wander < 0.03 + 3.0 * noise.accel / quarter;
}

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
  if (!config_.aiding.use_zero_velocity) return false;
  const ImuBlock& b = monitor_.block();
  const NavState& x = core.state();
  if (monitor_.frozen() || !calm(b, monitor_.noise())) return false;
  if ((b.gyro - x.gyro_bias).norm() > 4e-3) return false;
  return x.velocity.norm() < kStandingSpeed;
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
  s.standing = calm(b, monitor_.noise()) && v->value.norm() < kStandingSpeed &&
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
  s.antenna_cov = fix_->cov_enu + (moved * moved + 1e-4) * Eigen::Matrix3d::Identity();
  if (fix_->heading) {
    s.yaw = 0.5 * kPi - fix_->heading->heading;
    s.yaw_std =
        std::max(fix_->heading->sigma, config_.aiding.heading_floor * kDegree) + config_.vehicle.mounting_std.z();
  }
  bank_.start(*anchor_, s);
  forward_stale_ = true;
  phase_ = AlignmentPhase::kHeading;
}

void GnssIns::step_heading(const ImuSample& imu, double dt, const ImuNoise& noise, bool block_done) {
  bank_.predict(imu, dt, noise);
  const auto leader = [&]() -> const NavState& { return bank_.leader().state(); };
  pending_.take_due(leader, [&](const Pending& p) {
    note(bank_.aid([&](InsCore& core) { return applier_.apply(core, p, no_gates_); }), p.id);
  });
  if (due(next_sideslip_us_, imu.t_us, config_.aiding.sideslip_interval))
    note(bank_.aid([&](InsCore& core) { return applier_.sideslip(core, no_gates_, false); }), 0);
  if (due(next_heave_us_, imu.t_us, config_.aiding.heave_interval))
    note(bank_.aid([&](InsCore& core) { return applier_.heave(core, no_gates_, false); }), 0);
  if (block_done && standing_now(bank_.leader())) {
    note(bank_.aid([&](InsCore& core) { return applier_.standing_velocity(core, no_gates_); }), 0);
    note(bank_.aid([&](InsCore& core) { return applier_.standing_rate(core, monitor_.block(), no_gates_); }), 0);
  }
  if (!block_done || !bank_.confirmed()) return;
  core_.emplace(bank_.leader());
  core_->consider({});
  bank_.stop();
  phase_ = AlignmentPhase::kDone;
  forward_stale_ = true;
}

}  // namespace roadfix
