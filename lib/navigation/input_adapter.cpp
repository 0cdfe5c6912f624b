#include "navigation/input_adapter.h"

#include <algorithm>
#include <cmath>

#include "geometry/frames.h"
#include "vehicle/axle_speed.h"

namespace roadfix::navigation {

QueuedFix queued(const GnssFix& fix, int64_t id, const EnuAnchor& enu, const NavigationConfig& config) {
  const Eigen::Matrix3d to_enu = enu.R_anchor_enu_at(fix.antenna);
  const AidingConfig& a = config.aiding;
  const auto floored = [&](Eigen::Matrix3d cov, double floor) {
    for (int i = 0; i < 3; ++i) cov(i, i) = std::max(cov(i, i), floor * floor);
    return Eigen::Matrix3d(to_enu * cov * to_enu.transpose());
  };
  Queued q;
  q.t_us = fix.t_us;
  q.id = id;
  q.fix_type = fix.fix_type;
  QueuedFix out;
  if (config.sources.gnss_position) {
    q.value = enu.enu(fix.antenna);
    q.cov = floored(fix.cov_enu, a.position_floor);
    out.position = q;
  }
  if (fix.velocity && config.sources.gnss_velocity) {
    q.kind = Queued::Kind::kVelocity;
    q.value = to_enu * fix.velocity->enu;
    const bool given = fix.velocity->cov_enu.diagonal().minCoeff() > 0.0;
    q.cov = floored(fix.velocity->cov_enu, given ? a.velocity_floor : a.velocity_default);
    out.velocity = q;
  }
  if (fix.heading && std::isfinite(fix.heading->heading) && config.sources.gnss_heading) {
    q.kind = Queued::Kind::kHeading;
    const double yaw = 0.5 * kPi - fix.heading->heading;
    const Eigen::Vector3d direction = to_enu * Eigen::Vector3d(std::cos(yaw), std::sin(yaw), 0.0);
    q.value = Eigen::Vector3d(std::atan2(direction.y(), direction.x()), 0.0, 0.0);
    const double sigma = std::max(fix.heading->sigma, a.heading_floor);
    q.cov = sigma * sigma * Eigen::Matrix3d::Identity();
    out.heading = q;
  }
  return out;
}

std::optional<Queued> queued(const WheelSample& wheels, int64_t id, const NavigationConfig& config) {
  const std::optional<vehicle::AxleSpeed> axle = vehicle::axle_speed(wheels, config.facts.wheels);
  if (!axle) return std::nullopt;
  Queued q;
  q.kind = Queued::Kind::kWheels;
  q.t_us = wheels.t_us;
  q.id = id;
  q.direction = axle->direction;
  q.has_yaw_rate = axle->yaw_rate.has_value();
  q.has_sides = axle->sides_yaw_rate.has_value();
  q.value = {axle->speed, axle->yaw_rate.value_or(0.0), axle->sides_yaw_rate.value_or(0.0)};
  q.cov.diagonal() = Eigen::Vector3d(axle->sigma, config.facts.wheels.yaw_rate_noise, axle->sides_sigma).cwiseAbs2();
  return q;
}

std::optional<Queued> queued(const MagSample& mag, int64_t id, const NavigationConfig& config) {
  if (!mag.field.allFinite()) return std::nullopt;
  Queued q;
  q.kind = Queued::Kind::kMagnetic;
  q.t_us = mag.t_us;
  q.id = id;
  q.value = config.facts.soft_iron * (mag.field - config.facts.hard_iron);
  if (q.value.norm() <= 0.0) return std::nullopt;
  return q;
}

}  // namespace roadfix::navigation
