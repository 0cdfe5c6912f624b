// Wheel speed update: speed, slip, direction, standstill (MODEL.md, sections 6 to 8).
#include <algorithm>
#include <cmath>

#include "geometry/so3.h"
#include "wheel/wheel_kinematics.h"
#include "wheel/wheel_odometry.h"

namespace roadfix {

using namespace wheel;  // indices of the error state
namespace {

constexpr double kStandingSpeedSigma = 1e-3;    ///< m/s
constexpr double kTiltAtStart = 3.0 * kDegree;  ///< road cross fall and gradient, without an accelerometer
constexpr double kStartMoved = 0.02;            ///< m, possible motion below the wheel speed threshold at a pull-away

bool usable(const WheelSample& wheels) {
  constexpr double kLargestSpeed = 150.0, kLargestYawRate = 35.0;  // m/s, rad/s: beyond any car
  if (wheels.num_speeds != 1 && wheels.num_speeds != 4) return false;
  for (int i = 0; i < wheels.num_speeds; ++i)
    if (!(std::abs(wheels.speeds[static_cast<std::size_t>(i)]) < kLargestSpeed)) return false;
  return !wheels.yaw_rate || std::abs(*wheels.yaw_rate) < kLargestYawRate;
}

}  // namespace

WheelInputStatus WheelOdometry::add(const WheelSample& wheels) {
  if (!usable(wheels)) return WheelInputStatus::kBadValue;
  if (wheels_us_ && wheels.t_us <= *wheels_us_) return WheelInputStatus::kOld;
  if (!first_us_) first_us_ = wheels.t_us;
  const WheelMotion motion = wheel_motion(wheels, config_.sensors.track_width, config_.tuning.side_rule);
  const bool magnitude_only = wheels.direction == WheelDirection::kUnknown;
  const std::optional<int64_t> last_us = wheels_us_;
  wheels_us_ = wheels.t_us;
  estimate_resolution(motion.speed);
  wheel_yaw_rate_ = selected_yaw_rate(motion);

  const bool imu_silent = seconds_between(imu_us_.value_or(*first_us_), wheels.t_us) > config_.tuning.imu_timeout;
  if (!started_) {
    if (magnitude_only && !direction_.undecided_since_us) direction_.undecided_since_us = wheels.t_us;
    const double rate = wheel_speed_rate(last_us, wheels.t_us, motion.speed);
    last_speed_ = motion.speed;
    if (imu_silent) {
      t_us_ = wheels.t_us;
      start({0.0, 0.0}, kTiltAtStart);
    } else if (last_us) {
      align_by_accelerometer(rate);
    } else {
      reset_levelling();
    }
    return started_ ? WheelInputStatus::kUsed : WheelInputStatus::kAligning;
  }
  const double sign = magnitude_only && direction_.sign < 0 ? -1.0 : 1.0;
  if (imu_silent && wheels.t_us > t_us_) {
    const double speed_gain = magnitude_only && direction_.sign == 0 ? 0.0 : sign * motion.speed - state_.x(kSpeed);
    propagate_without_imu(wheels.t_us, speed_gain / seconds_between(t_us_, wheels.t_us));
  }
  const double dt_s = last_us ? seconds_between(*last_us, wheels.t_us) : 1.0;
  const WheelInputStatus status = fuse_speed(wheels.t_us, dt_s, motion.speed, magnitude_only);
  last_speed_ = sign * motion.speed;
  const bool slipping = status == WheelInputStatus::kSlip;
  if (config_.tuning.correct_acceleration) level_by_wheels(last_us, wheels.t_us, slipping);
  update_standstill(wheels.t_us, motion.speed, !slipping);
  return status;
}

std::optional<double> WheelOdometry::selected_yaw_rate(const WheelMotion& motion) const {
  switch (config_.tuning.yaw_source) {
    case YawSource::kVehicleSensor:
      return motion.sensor_yaw_rate;
    case YawSource::kWheelSides:
      return motion.sides_yaw_rate;
    case YawSource::kAutomatic:
      return motion.sensor_yaw_rate ? motion.sensor_yaw_rate : motion.sides_yaw_rate;
    case YawSource::kGyro:
      break;
  }
  return std::nullopt;
}

/// Acceleration from two successive wheel samples.
double WheelOdometry::wheel_speed_rate(std::optional<int64_t> last_us, int64_t t_us, double speed) const {
  return last_us ? (speed - last_speed_) / seconds_between(*last_us, t_us) : 0.0;
}

WheelVector WheelOdometry::speed_jacobian() const {
  const double scale = 1.0 + state_.x(kWheelScale);
  WheelVector H = WheelVector::Zero();
  H(kSpeed) = 1.0 / scale;
  H(kWheelScale) = -state_.x(kSpeed) / (scale * scale);
  return H;
}

/// Predicted wheel speed at t_us, from the slightly older state (W.6.2).
double WheelOdometry::predicted_speed(int64_t t_us) const {
  return (state_.x(kSpeed) + forward_acceleration_ * seconds_between(t_us_, t_us)) / (1.0 + state_.x(kWheelScale));
}

/// Speed with the sign of the more likely direction; no value while undecided.
std::optional<double> WheelOdometry::resolve_sign(int64_t t_us, double magnitude, double predicted, double variance) {
  const WheelTuning& t = config_.tuning;
  if (magnitude < t.standing_speed) return std::clamp(predicted, -magnitude, magnitude);
  update_direction(direction_, {t.direction_evidence, t.direction_timeout}, t_us, magnitude, predicted, variance);
  if (direction_.sign == 0) return std::nullopt;
  return direction_.sign * magnitude;
}

WheelInputStatus WheelOdometry::fuse_speed(int64_t t_us, double dt_s, double speed, bool magnitude_only) {
  const double noise = std::pow(std::hypot(config_.sensors.wheel_noise, rounding_noise(dt_s)), 2);
  const WheelVector H = speed_jacobian();
  const double predicted = predicted_speed(t_us);
  const double S = H.dot(state_.P * H) + noise;
  if (magnitude_only) {
    const std::optional<double> signed_speed = resolve_sign(t_us, speed, predicted, S);
    if (!signed_speed) return WheelInputStatus::kNoDirection;
    speed = *signed_speed;
  } else {
    direction_ = DirectionState{};
  }
  const double innovation = speed - predicted;
  if (innovation * innovation > config_.tuning.slip_gate * config_.tuning.slip_gate * S) {
    if (!slip_since_us_) slip_since_us_ = t_us;
    if (seconds_between(*slip_since_us_, t_us) < config_.tuning.slip_timeout) return WheelInputStatus::kSlip;
    state_.P(kSpeed, kSpeed) += innovation * innovation;  // too long for slip: accept the wheel speed again
  }
  slip_since_us_.reset();
  schmidt_update(state_, H, innovation, noise, {kSpeed});
  return WheelInputStatus::kUsed;
}

void WheelOdometry::update_standstill(int64_t t_us, double speed, bool trusted) {
  const WheelTuning& t = config_.tuning;
  const bool stood = standstill_.standing;
  add_speed(standstill_, {t.standing_speed, t.standing_rate, t.standing_after}, t_us, speed, trusted);
  if (standstill_.standing && !stood) {
    state_.x(kSpeed) = 0.0;
    decouple(state_.P, kSpeed, kStandingSpeedSigma);
    direction_ = DirectionState{};
    block_gyro_.setZero();
    block_time_ = 0.0;
    turning_at_standstill_ = bias_tested_ = false;
  }
  if (stood && !standstill_.standing) {
    decouple(state_.P, kSpeed, t.standing_speed);
    state_.P.block<2, 2>(kPos, kPos) += kStartMoved * kStartMoved * Eigen::Matrix2d::Identity();
  }
}

}  // namespace roadfix
