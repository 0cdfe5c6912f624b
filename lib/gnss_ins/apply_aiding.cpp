#include "gnss_ins/apply_aiding.h"

#include <algorithm>
#include <cmath>

#include "geometry/frames.h"
#include "statistics/chi_square.h"

namespace roadfix {

namespace {

// A heading this sure bends the velocity of a car at 30 m/s by a millimetre per second: not worth computing.
constexpr double kSureHeading = 0.5 * kDegree;
// What is left out is the same function of the same errors until fixes have changed these: a second, as they come.
constexpr double kBentTime = 1.0;        // s
constexpr double kLeastInterval = 0.01;  // s
// Below this speed an unsigned wheel speed is not told apart from its negative.
constexpr double kUnsignedMin = 0.3;  // m/s

AidingRecord not_ready(AidingSource source, int64_t t_us) {
  AidingRecord r;
  r.t_us = t_us;
  r.source = source;
  return r;
}

/// Takes into account what the linear H leaves out of one axis of the vehicle's velocity, used every `interval_s`,
/// while the heading is unsure. `gain`: of the measurement by that velocity. The update takes it for an error that
/// lasts; gate and likelihood ask for one residual, and with more they forgave hypotheses what only the right one may.
void straighten(Measurement<1>& m, const InsCore& core, int axis, double gain, double interval_s) {
  if (core.heading_std() < kSureHeading) return;
  const SecondOrder bent = bent_velocity(core.state(), core.last_covariance());
  const double rho = std::exp(-interval_s / kBentTime);
  m.residual(0) -= gain * bent.mean(axis);
  const double known = m.R(0, 0), left_out = gain * gain * bent.variance(axis);
  m.R(0, 0) += left_out;
  m.alike = (known + left_out * (1.0 + rho) / (1.0 - rho)) / m.R(0, 0);  // Bartlett 1946
}

Measurement<3> position_of(const InsCore& core, const Pending& p) {
  Measurement<3> m = gnss_position(core.state(), core.motion(), p.value, p.cov, p.ahead(core.state()));
  m.alike = p.alike;
  if (p.fix_type != FixType::kRtkFixed && core.fix_error().active()) {
    m.displaced = 0;
    m.residual -= core.displacement();
    m.R *= 1.0 - core.fix_error().lasting_share();
  }
  return m;
}

/// Receivers smooth their velocities, which in a turn looks like an antenna elsewhere: its place is doubt, and not
/// learnt.
Measurement<3> velocity_of(const InsCore& core, const Pending& p) {
  Measurement<3> m = gnss_velocity(core.state(), core.motion(), p.value, p.cov, p.ahead(core.state()));
  const Eigen::Matrix3d by_antenna = m.H.middleCols<3>(kAntenna);
  m.R += by_antenna * core.last_covariance().block<3, 3>(kAntenna, kAntenna) * by_antenna.transpose();
  m.H.middleCols<3>(kAntenna).setZero();
  return m;
}

}  // namespace

Gates::Gates(double sigma) {
  const double tail = std::erfc(sigma / std::sqrt(2.0));
  for (int dof = 1; dof <= 3; ++dof) nis[static_cast<size_t>(dof)] = chi_square_quantile(1.0 - tail, dof);
}

AidingApplier::AidingApplier(const GnssInsConfig& config)
    : config_(config),
      lateral_(config.sideslip, config.sideslip.start_std, config.sideslip.prior_count),
      vertical_(config.sideslip, config.sideslip.heave_start_std, config.sideslip.heave_prior_count) {}

AidingRecord AidingApplier::apply(InsCore& core, const Pending& p, const Gates& gates) const {
  const GnssInsVehicle& v = config_.vehicle;
  const NavState& x = core.state();
  switch (p.kind) {
    case PendingKind::kPosition:
      return core.fuse(AidingSource::kGnssPosition, p.t_us, position_of(core, p), gates.nis[3]);
    case PendingKind::kVelocity:
      return core.fuse(AidingSource::kGnssVelocity, p.t_us, velocity_of(core, p), gates.nis[3]);
    case PendingKind::kHeading:
      return core.fuse(AidingSource::kGnssHeading, p.t_us, vehicle_yaw(x, p.value.x(), std::sqrt(p.cov(0, 0))),
                       gates.nis[1]);
    case PendingKind::kWheels:
      return wheels(core, p, gates);
    case PendingKind::kMag:
      return core.fuse(AidingSource::kMagHeading, p.t_us,
                       magnetic_heading(x, p.value, v.magnetic_declination, config_.aiding.mag_std), gates.nis[1]);
  }
  return not_ready(AidingSource::kGnssPosition, p.t_us);
}

bool AidingApplier::agrees_undisplaced(const InsCore& core, const Pending& p, const Gates& gates) const {
  if (p.fix_type == FixType::kRtkFixed || !core.fix_error().returning()) return false;
  InsCore plain = core;
  plain.end_return();
  return apply(plain, p, gates).status == AidingStatus::kAccepted;
}

AidingRecord AidingApplier::apply_level(InsCore& core, const Pending& p, const Gates& gates) const {
  const Measurement<3> all = position_of(core, p);
  Measurement<2> level;
  level.residual = all.residual.head<2>();
  level.H = all.H.topRows<2>();
  level.R = all.R.topLeftCorner<2, 2>();
  level.displaced = all.displaced;
  level.alike = p.alike;
  return core.fuse(AidingSource::kGnssPosition, p.t_us, level, gates.nis[2]);
}

AidingRecord AidingApplier::apply_height(InsCore& core, const Pending& p, const Gates& gates) const {
  const Measurement<3> all = position_of(core, p);
  Measurement<1> height;
  height.residual = all.residual.tail<1>();
  height.H = all.H.bottomRows<1>();
  height.R = all.R.bottomRightCorner<1, 1>();
  if (all.displaced >= 0) height.displaced = 2;
  height.alike = p.alike;
  return core.fuse(AidingSource::kGnssPosition, p.t_us, height, gates.nis[1]);
}

AidingRecord AidingApplier::wheels(InsCore& core, const Pending& p, const Gates& gates) const {
  const NavState& x = core.state();
  const double sigma = std::sqrt(p.cov(0, 0));
  double speed = p.value.x();
  Measurement<1> m = wheel_speed(x, core.motion(), speed, sigma, p.ahead(x));
  if (p.direction == WheelDirection::kReverse) speed = -std::abs(speed);
  if (p.direction == WheelDirection::kForward) speed = std::abs(speed);
  if (p.direction == WheelDirection::kUnknown) {
    const double predicted = p.value.x() - m.residual(0);
    if (std::abs(speed) < kUnsignedMin || std::abs(predicted) < kUnsignedMin)
      return not_ready(AidingSource::kWheelSpeed, p.t_us);
    speed = std::copysign(speed, predicted);
  }
  m.residual(0) += speed - p.value.x();
  if (config_.aiding.use_second_order)
    straighten(m, core, 0, 1.0 / (1.0 + x.wheel_scale), std::max(config_.aiding.wheel_interval, kLeastInterval));
  return core.fuse(AidingSource::kWheelSpeed, p.t_us, m, gates.nis[1]);
}

AidingRecord AidingApplier::sideslip(InsCore& core, const Gates& gates, Beside beside) {
  return hold_track(core, 0, lateral_, gates.nis[1], beside);
}

AidingRecord AidingApplier::heave(InsCore& core, const Gates& gates, Beside beside) {
  return hold_track(core, 1, vertical_, gates.nis[1], beside);
}

AidingRecord AidingApplier::hold_track(InsCore& core, int axis, SideslipNoise& noise, double gate,
                                       Beside beside) const {
  const NavState& x = core.state();
  const Measurement<2> both = no_sideslip(x, core.motion());
  // Tyres slip with the lateral acceleration, springs give with any.
  const BodyMotion& motion = core.motion();
  const double acceleration = axis == 0 ? x.velocity.norm() * motion.rate.z() : motion.acceleration.head<2>().norm();
  const double sigma = noise.sigma(acceleration);
  Measurement<1> m;
  m.residual(0) = both.residual(axis);
  m.H = both.H.row(axis);
  m.R(0, 0) = sigma * sigma;
  // Without fixes these errors stay as they are for much longer than kBentTime, and this is all that holds them.
  if (beside != Beside::kNothing && config_.aiding.use_second_order)
    straighten(m, core, 1 + axis, 1.0, axis == 0 ? config_.aiding.sideslip_interval : config_.aiding.heave_interval);
  const AidingRecord r = core.fuse(AidingSource::kNoSideslip, x.t_us, m, gate);
  if (beside == Beside::kFixes && x.velocity.norm() > config_.sideslip.min_speed && r.status != AidingStatus::kBadInput)
    noise.learn(
        {m.residual(0), r.innovation_variance[0] - sigma * sigma, sigma * sigma, r.status == AidingStatus::kAccepted},
        acceleration);
  return r;
}

AidingRecord AidingApplier::standing_velocity(InsCore& core, const Gates& gates) const {
  return core.fuse(AidingSource::kZeroVelocity, core.state().t_us,
                   zero_velocity(core.state(), config_.aiding.zero_velocity_std), gates.nis[3]);
}

AidingRecord AidingApplier::standing_rate(InsCore& core, const ImuBlock& block, const Gates& gates) const {
  const double sigma = std::hypot(config_.aiding.zero_rate_std, config_.vehicle.gyro_noise / std::sqrt(block.duration));
  return core.fuse(AidingSource::kZeroRate, core.state().t_us,
                   zero_rate(core.state(), block.gyro, core.earth().rate(), sigma), gates.nis[3]);
}

}  // namespace roadfix
