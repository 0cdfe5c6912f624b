#include "navigation/aiding/wheel_speed/wheel_speed_control.h"

#include <algorithm>
#include <cmath>

#include "navigation/aiding/axle_rows.h"
#include "navigation/aiding/second_order.h"
#include "navigation/aiding/wheel_speed/wheel_speed_model.h"
#include "vehicle/axle_speed.h"
#include "vehicle/driving.h"

namespace roadfix::navigation {

namespace {

// Speeds that are rejected in a row and differ by one factor have another scale: soon where it is a tyre's or a
// source's (10 %), later where it may be a wheel that spins.
constexpr double kSoon = 0.45, kLater = 5.0;  // s
constexpr double kTyre = 0.1, kMost = 0.5;

std::optional<Measurement<1>> measurement(const Filter& filter, const Queued& wheels, double interval) {
  const double ahead = wheels.ahead(filter.state().x);
  const AxleRows axle(filter.state(), filter.motion(), ahead);
  const vehicle::AxleSpeed told{wheels.value.x(), 0.0, wheels.direction, {}, {}, 0.0};
  const std::optional<double> speed = vehicle::signed_speed(told, axle.value.x());
  if (!speed) return std::nullopt;
  Measurement<1> m = wheel_speed(filter.state(), filter.motion(), *speed, std::sqrt(wheels.cov(0, 0)), ahead);
  add_second_order(m, filter, 0, 1.0 + filter.state().x.wheel_scale, interval);
  return m;
}

}  // namespace

AidingRecord WheelSpeedControl::try_on(Filter& filter, const Queued& wheels) const {
  const std::optional<Measurement<1>> m = measurement(filter, wheels, interval_);
  if (!m) return record_of(AidingSource::kWheelSpeed, AidingStatus::kNotReady, wheels.t_us);
  return filter.fuse(AidingSource::kWheelSpeed, wheels.t_us, *m, Gates::open().nis[1]);
}

AidingRecord WheelSpeedControl::use(Filter& filter, const Queued& wheels) {
  const std::optional<Measurement<1>> m = measurement(filter, wheels, interval_);
  if (!m) return record_of(AidingSource::kWheelSpeed, AidingStatus::kNotReady, wheels.t_us);
  const AidingRecord r = filter.fuse(AidingSource::kWheelSpeed, wheels.t_us, *m, gates_.nis[1]);
  if (r.status == AidingStatus::kGated && detects_steps_)
    widen_scale(filter, wheels, r);
  else if (r.status == AidingStatus::kAccepted)
    rejected_ = 0;
  return r;
}

/// (N.5.7): P_s += excess^2 where rejected speeds agree on the excess.
void WheelSpeedControl::widen_scale(Filter& filter, const Queued& wheels, const AidingRecord& r) {
  const double speed = AxleRows(filter.state(), filter.motion(), 0.0).value.x();
  if (std::abs(speed) < vehicle::kSlow) return;
  const double excess = r.innovation[0] / speed;
  if (rejected_++ == 0) {
    rejected_since_us_ = wheels.t_us;
    excess_sum_ = 0.0;
    excess_least_ = excess_most_ = excess;
  }
  excess_sum_ += excess;
  excess_least_ = std::min(excess_least_, excess);
  excess_most_ = std::max(excess_most_, excess);
  const double mean = excess_sum_ / rejected_;
  const double wait = std::abs(mean) > kTyre ? kLater : kSoon;
  if (std::abs(mean) > kMost || excess_most_ - excess_least_ > std::abs(mean)) return;
  if (seconds_between(rejected_since_us_, wheels.t_us) < wait) return;
  BaseVector wider = BaseVector::Zero();
  wider(kWheelScale) = mean;
  filter.widen(wider);
  rejected_ = 0;
  ++scale_steps_;
}

}  // namespace roadfix::navigation
