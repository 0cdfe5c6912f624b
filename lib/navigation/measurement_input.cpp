#include "navigation/measurement_input.h"

namespace roadfix::navigation {

namespace {

constexpr double kWheelPeriodSlack = 0.005;  // s
constexpr double kMoving = 0.5;              // m/s, at which no two places are the same

}  // namespace

AidingStatus MeasurementInput::screen(const GnssFix& fix, double speed) {
  const bool same_place = fix.antenna.latitude == last_fix_.latitude && fix.antenna.longitude == last_fix_.longitude &&
                          fix.antenna.height == last_fix_.height;
  if (same_place && fix.t_us == last_fix_us_) return AidingStatus::kBadInput;
  const bool moving = speed > kMoving || (fix.velocity && fix.velocity->enu.norm() > kMoving);
  return same_place && moving ? screen_.repeated() : screen_.check(fix);
}

void MeasurementInput::add(const GnssFix& fix, int64_t id, const Geodetic& anchor) {
  last_fix_us_ = fix.t_us;
  last_fix_ = fix.antenna;
  const QueuedFix all = queued(fix, id, EnuAnchor(anchor), config_);
  for (const std::optional<Queued>& q : {all.position, all.velocity, all.heading})
    if (q) queue_.push(*q);
}

void MeasurementInput::add(Queued q) {
  const bool wheels = q.kind == Queued::Kind::kWheels;
  int64_t& last_us = wheels ? last_wheel_us_ : last_magnetic_us_;
  const double interval = wheels ? config_.aiding.wheel_interval - kWheelPeriodSlack : config_.aiding.magnetic_interval;
  const double since = seconds_between(last_us, q.t_us);
  if (since < interval) return;
  last_us = q.t_us;
  if (wheels) {
    const double rounding = rounding_.of_many(since), track_width = config_.facts.wheels.track_width;
    q.cov(0, 0) += rounding * rounding;
    q.cov(2, 2) += 2.0 * rounding * rounding / (track_width * track_width);
  }
  queue_.push(q);
}

}  // namespace roadfix::navigation
