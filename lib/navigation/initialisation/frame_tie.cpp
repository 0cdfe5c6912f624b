#include "navigation/initialisation/frame_tie.h"

#include <cmath>

#include "geometry/so3.h"
#include "navigation/initialisation/heading_hypotheses.h"
#include "statistics/chance.h"

namespace roadfix::navigation {

namespace {

constexpr double kFixAge = 3.0;      // s, of a velocity or a heading beside a position
constexpr double kSmoothing = 0.5;   // s, by which a receiver's low pass may delay its velocity
constexpr double kOtherTurn = 0.26;  // rad: more than this, a difference is none of what lasts in a receiver's errors

double angle_of(const Eigen::Vector3d& v) { return std::atan2(v.y(), v.x()); }
double worse_variance(const Eigen::Matrix3d& cov) { return std::max(cov(0, 0), cov(1, 1)); }

}  // namespace

double velocity_std(const State& state) { return std::sqrt(state.P().diagonal().segment<3>(kVel).maxCoeff()); }

void FrameTie::restart() {
  from_.reset();
  by_velocity_.reset();
  by_heading_.reset();
  last_.reset();
}

/// (N.7.9)
std::optional<FrameTie::Turn> FrameTie::by_velocity(const Queued& q, const Filter& filter) const {
  const Mean& x = filter.state().x;
  const double ahead = q.ahead(x);
  const Eigen::Vector3d v = x.nav.velocity + x.nav.q_level_imu * filter.motion().rate.cross(x.p_imu_antenna) +
                            ahead * filter.motion().acceleration;
  const double late = std::hypot(config_.facts.velocity_latency_std, config_.facts.time_offset_std, kSmoothing);
  const double std = std::hypot(std::sqrt(worse_variance(q.cov)), velocity_std(filter.state()),
                                late * filter.motion().acceleration.head<2>().norm());
  const double speed = v.head<2>().norm();
  // Vectors that differ in length are not one velocity in two frames.
  if (std::abs(q.value.head<2>().norm() - speed) > kChance * std || speed < kChance * std) return std::nullopt;
  return Turn{wrap_angle(angle_of(q.value) - angle_of(v)), std / speed};
}

/// (N.7.10)
std::optional<FrameTie::Turn> FrameTie::by_way(const Place& now, const Filter& filter) {
  if (!from_) {
    from_ = now;
    return std::nullopt;
  }
  const Eigen::Vector3d enu = now.enu - from_->enu, local = now.local - from_->local;
  const double drift = velocity_std(filter.state()) * seconds_between(from_->t_us, now.t_us);
  const double late = std::hypot(config_.facts.position_latency_std, config_.facts.time_offset_std) *
                      filter.state().x.nav.velocity.norm();
  const double std = std::hypot(std::sqrt(from_->variance + now.variance), drift, late);
  const double way = local.head<2>().norm();
  if (std::abs(enu.head<2>().norm() - way) > kChance * std) {
    from_ = now;  // one of the two is no fix of this way
    return std::nullopt;
  }
  if (way < kChance * std) return std::nullopt;
  return Turn{wrap_angle(angle_of(enu) - angle_of(local)), std / way};
}

std::optional<FrameTie::Turn> FrameTie::best_of(const std::optional<Turn>& by_way, int64_t t_us) const {
  std::optional<Turn> best = by_way;
  const auto take = [&](const std::optional<Turn>& turn, int64_t from_us) {
    if (turn && seconds_between(from_us, t_us) < kFixAge && (!best || turn->std < best->std)) best = turn;
  };
  take(by_velocity_, velocity_us_);
  take(by_heading_, heading_us_);
  return best;
}

std::optional<FrameTie::Turn> FrameTie::add(const Queued& q, const Filter& filter) {
  const Mean& x = filter.state().x;
  if (q.kind == Queued::Kind::kVelocity) {
    by_velocity_ = by_velocity(q, filter);
    velocity_us_ = q.t_us;
    return std::nullopt;
  }
  if (q.kind == Queued::Kind::kHeading) {
    by_heading_ = Turn{wrap_angle(q.value.x() - vehicle_yaw(x)),
                       std::hypot(std::sqrt(q.cov(0, 0)), config_.facts.mounting_std.z())};
    heading_us_ = q.t_us;
    return std::nullopt;
  }
  const Eigen::Vector3d antenna = x.nav.position + x.nav.q_level_imu * x.p_imu_antenna + q.ahead(x) * x.nav.velocity;
  const std::optional<Turn> before = last_;
  last_ = best_of(by_way({q.t_us, q.value, antenna, worse_variance(q.cov)}, filter), q.t_us);
  if (!before || !last_ || last_->std > config_.start.confirm_std) return std::nullopt;
  const double apart = std::abs(wrap_angle(last_->value - before->value));
  if (apart > std::min(kOtherTurn, kChance * std::hypot(before->std, last_->std))) {
    from_.reset();
    return std::nullopt;
  }
  return last_;
}

}  // namespace roadfix::navigation
