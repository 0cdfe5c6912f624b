#include "navigation/motion/car_motion.h"
#include "statistics/chance.h"

#include <algorithm>
#include <cmath>

namespace roadfix::navigation {

namespace {

constexpr double kHole = 2.0;             // s without wheels, after which nothing is known of the way between
constexpr double kLongestSteps = 12.0;    // s of time that pass in steps; longer is a gap
constexpr double kCreep = 0.3;            // m/s: the heading of a car that hardly moves hardly turns
constexpr double kUsualInterval = 0.2;    // s between yaw rates, at most
constexpr double kRestRate = 2.0e-4;      // rad/s: a car at rest does not turn
constexpr double kRestAfter = 0.3;        // s: the last turn of a slow wheel is long
constexpr double kYawRateScale = 5.0e-3;  // of a car's yaw rate sensor (assumed; data sheets give 0.5 to 1 %)

}  // namespace

NavigationConfig without_imu(NavigationConfig config) {
  VehicleFacts& v = config.facts;
  v.has_imu = false;
  v.gyro_bias_std = v.wheels.yaw_rate_bias;
  v.accel_bias_std = 0.0;
  v.scale_std = kYawRateScale;
  v.mounting.setZero();
  v.mounting_std.setZero();
  v.wheel_latency_std = 0.0;  // their stamps are the clock
  v.imu.gyro = v.wheels.yaw_rate_noise * std::sqrt(kUsualInterval);
  config.aiding.zero_rate_std = kRestRate;
  config.aiding.vertical_interval = config.aiding.lateral_interval;
  config.start.confirm_std = config.car.confirm_std;
  return config;
}

inertial::Earth earth_of(const NavigationConfig& config, const std::optional<Geodetic>& anchor) {
  if (!config.facts.has_imu) return inertial::Earth::kinematic();
  return anchor ? inertial::Earth(*anchor) : inertial::Earth();
}

void CarMotion::begin_interval(int64_t t_us) {
  begun_us_ = newest_us_;
  newest_us_ = t_us;
  rate_before_ = rate_;
  speed_before_ = speed_;
}

void CarMotion::see_wheels(int64_t t_us, const vehicle::AxleSpeed& axle) {
  begin_interval(t_us);
  const bool hole = begun_us_ == 0 || seconds_between(begun_us_, t_us) > kHole || !by_wheels_;
  by_wheels_ = true;
  const bool backwards = axle.direction == WheelDirection::kReverse;
  speed_ = backwards ? -std::abs(axle.speed) : axle.speed;
  std::optional<double> rate = axle.yaw_rate;
  rate_sigma_ = config_.facts.wheels.yaw_rate_noise;
  if (!rate && axle.sides_yaw_rate) {
    // Magnitudes turn their difference with the direction; where that is not known, a car drives forward.
    rate = backwards && axle.speed >= 0.0 ? -*axle.sides_yaw_rate : *axle.sides_yaw_rate;
    rate_sigma_ = axle.sides_sigma;
  }
  rate_ = rate.value_or(0.0);
  interval_ = begun_us_ == 0 ? 0.0 : seconds_between(begun_us_, t_us);
  if (hole || !rate) {
    if (turning_until_us_ < begun_us_) turning_from_us_ = begun_us_;
    turning_until_us_ = t_us;
    rate_before_ = rate_;
  }
  const bool rests = std::abs(axle.speed) < kChance * axle.sigma;
  if (!rests || hole) standing_since_us_ = 0;
  if (rests && standing_since_us_ == 0) standing_since_us_ = t_us;
}

void CarMotion::see_nothing(int64_t t_us) {
  begin_interval(t_us);
  if (turning_until_us_ < begun_us_) turning_from_us_ = begun_us_;
  turning_until_us_ = t_us;
  rate_ = rate_before_ = 0.0;
  by_wheels_ = false;
  standing_since_us_ = 0;
}

int CarMotion::steps() const {
  if (begun_us_ == 0) return 1;
  const double dt = seconds_between(begun_us_, newest_us_);
  return dt > kLongestSteps ? 1 : static_cast<int>(std::ceil(dt / kStep - 1e-6));
}

ImuSample CarMotion::sample(int64_t t_us, double share) const {
  ImuSample s;
  s.t_us = t_us;
  const double rate = rate_before_ + share * (rate_ - rate_before_);
  s.gyro.z() = rate;
  s.accel.y() = by_wheels_ ? rate * (speed_before_ + share * (speed_ - speed_before_)) : 0.0;
  return s;
}

inertial::ImuNoise CarMotion::noise(int64_t t_us, double speed) const {
  const CarMotionConfig& c = config_.car;
  const bool unknown = t_us > turning_from_us_ && t_us <= turning_until_us_;
  const double measured = rate_sigma_ * std::sqrt(interval_);
  return {unknown ? c.turn_noise * std::clamp(speed, kCreep, c.turn_speed) / c.turn_speed : measured,
          c.acceleration_noise, c.tilt_std * std::sqrt(2.0 / c.tilt_time)};
}

bool CarMotion::level_due(int64_t t_us) {
  if (seconds_between(level_at_us_, t_us) < config_.car.level_interval - 0.5 * kStep) return false;
  level_at_us_ = t_us;
  return true;
}

/// A walk of density q that is measured every T with sigma s settles at sqrt(q T s^2) for s^2 far above q T: at tilt_std
/// for this s.
double CarMotion::level_std() const {
  return config_.car.tilt_std * std::sqrt(config_.car.tilt_time / (2.0 * config_.car.level_interval));
}

bool CarMotion::standing(int64_t t_us, double duration) const {
  return standing_since_us_ != 0 && seconds_between(standing_since_us_, t_us) >= duration + kRestAfter;
}

}  // namespace roadfix::navigation
