#include "navigation/aiding/nonholonomic/nonholonomic_control.h"

#include "navigation/aiding/nonholonomic/nonholonomic_model.h"
#include "navigation/aiding/second_order.h"
#include "navigation/aiding/wheel_speed/wheel_speed_control.h"
#include "vehicle/driving.h"

namespace roadfix::navigation {

namespace {

constexpr int64_t kDueEarly_us = 20'000;  // so that an interval of whole wheel periods is not missed by jitter

/// Tyres slip with the lateral acceleration, springs give with any horizontal one.
double acceleration_of(const Filter& filter, int axis) {
  const BodyMotion& m = filter.motion();
  return axis == 1 ? filter.state().x.nav.velocity.norm() * m.rate.z() : m.acceleration.head<2>().norm();
}

}  // namespace

bool NonholonomicControl::joins(bool wheels, int64_t t_us) {
  if (wheels) wheels_at_us_ = t_us;
  return wheels || seconds_between(wheels_at_us_, t_us) > WheelSpeedControl::kSilent;
}

bool NonholonomicControl::due(int axis, int64_t t_us) {
  if (!config_.sources.nonholonomic || !config_.facts.mounting_known()) return false;
  int64_t& next = next_us_[static_cast<size_t>(axis - 1)];
  if (t_us < next) return false;
  next = t_us + static_cast<int64_t>(1e6 * interval(axis)) - kDueEarly_us;
  return true;
}

double NonholonomicControl::interval(int axis) const {
  return axis == 1 ? config_.aiding.lateral_interval : config_.aiding.vertical_interval;
}

double NonholonomicControl::sigma(const Filter& filter, int axis) const {
  return (axis == 1 ? lateral_ : vertical_).sigma(acceleration_of(filter, axis));
}

AidingRecord NonholonomicControl::use(Filter& filter, int axis, bool learn) {
  const double std = sigma(filter, axis), acceleration = acceleration_of(filter, axis);
  Measurement<1> m = nonholonomic(filter.state(), filter.motion(), axis, std);
  if (learn) add_second_order(m, filter, axis, 1.0, interval(axis));
  const AidingRecord r = filter.fuse(AidingSource::kNonholonomic, filter.state().x.t_us, m, gates_.nis[1]);
  if (learn && filter.state().x.nav.velocity.norm() > vehicle::kSlow && r.status != AidingStatus::kBadInput)
    (axis == 1 ? lateral_ : vertical_)
        .learn({m.residual(0), r.innovation_variance[0] - std * std, std * std, r.status == AidingStatus::kAccepted},
               acceleration);
  return r;
}

AidingRecord NonholonomicControl::try_on(Filter& filter, int axis) const {
  Measurement<1> m = nonholonomic(filter.state(), filter.motion(), axis, sigma(filter, axis));
  add_second_order(m, filter, axis, 1.0, interval(axis));
  return filter.fuse(AidingSource::kNonholonomic, filter.state().x.t_us, m, Gates::open().nis[1]);
}

}  // namespace roadfix::navigation
