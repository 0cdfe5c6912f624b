// What comes in beside the IMU: screened, turned into the anchor's frame and kept until the state reaches its moment.
#include <algorithm>
#include <cmath>
#include <tuple>

#include "geometry/frames.h"
#include "gnss_ins/gnss_ins.h"

namespace roadfix {

namespace {

constexpr double kTellsOn = 1.5;     // s between two velocities, at most, whose way is known
constexpr double kFixSpacing = 0.5;  // s, at least, between the two fixes that a start takes a velocity from

}  // namespace

void GnssIns::add(const GnssFix& fix, int64_t id) {
  const bool again = fix.t_us == last_fix_us_ && fix.antenna.latitude == last_fix_.latitude &&
                     fix.antenna.longitude == last_fix_.longitude && fix.antenna.height == last_fix_.height;
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
  if (last_fix_us_ != 0 && seconds_between(last_fix_us_, fix.t_us) > kOutage) resumed_us_ = fix.t_us;
  last_fix_us_ = fix.t_us;
  last_fix_ = fix.antenna;
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
  p.fix_type = fix.fix_type;
  p.value = enu_->enu(fix.antenna);
  p.cov = floored(fix.cov_enu, a.position_floor);
  const bool tells = fix.velocity && a.use_gnss_velocity;
  if (tells) {
    add_up(fix.t_us, p.value, to_enu * fix.velocity->enu);
    p.contradiction = contradiction_;
    p.told_since_us = told_since_us_;
  }
  pending_.push(p);
  if (tells) {
    p.kind = PendingKind::kVelocity;
    p.value = told_velocity_;
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

/// What the receiver has gone further since its last fix than its velocities say, while these come.
void GnssIns::add_up(int64_t t_us, const Eigen::Vector3d& place, const Eigen::Vector3d& velocity) {
  const double dt = seconds_between(told_us_, t_us);
  const Eigen::Vector3d since_last = place - told_place_ - 0.5 * dt * (told_velocity_ + velocity);
  if (told_us_ == 0 || dt > kTellsOn) {
    told_since_us_ = t_us;
    contradiction_.setZero();
  } else {
    contradiction_ += since_last;
  }
  told_us_ = t_us;
  told_place_ = place;
  told_velocity_ = velocity;
}

void GnssIns::remember(const GnssFix& fix) {
  // Of two fixes of one moment the surer one, whichever came first.
  const auto rank = [](const GnssFix& f) {
    return std::tuple(f.cov_enu.trace(), f.antenna.latitude, f.antenna.longitude, f.antenna.height);
  };
  if (fix_ && fix_->t_us == fix.t_us) {
    if (rank(fix) < rank(*fix_)) {
      if (fix_before_ && fix_before_->t_us == fix.t_us) fix_before_ = fix;
      fix_ = fix;
    }
    return;
  }
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

}  // namespace roadfix
