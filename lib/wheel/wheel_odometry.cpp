#include "wheel/wheel_odometry.h"

#include <cmath>
#include <utility>

#include "geometry/so3.h"
#include "wheel/travel.h"

namespace roadfix {

using namespace wheel;  // the names of the error state
namespace {

constexpr double kLargestRate = 35.0;           ///< rad/s, full scale of automotive gyros
constexpr double kLargestForce = 400.0;         ///< m/s2, full scale of accelerometers
constexpr double kUnknownTilt = 3.0 * kDegree;  ///< roads' cross fall and slopes, where no accelerometer tells
constexpr double kUnknownAcceleration = 1.5;    ///< m/s2 per sqrt(Hz): 1.5 m/s2 for a second
constexpr double kUnknownRate = 0.1;            ///< rad/s per sqrt(Hz): a street corner within a few seconds
constexpr double kPlainDisturbance = 3.0;       ///< m/s2 per sqrt(Hz): 1.5 m/s2 over 2 s, uncorrected driving
constexpr double kPlainLevelling = 0.05;        ///< s of force per levelling without wheels
constexpr double kSpeedRateNoise = 0.2;         ///< m/s2 of wheel noise that a levelling may have, a fifth of its gate
constexpr double kSameSpeed = 1e-6;             ///< m/s, of numbers that are meant to be equal
constexpr int kChangesEnough = 20;              ///< of the speed, that tell in which steps it comes
constexpr double kRounding = 1.0;               ///< s over which a rounding error stays
constexpr double kTurnTime = 3.0;               ///< s that a turn lasts, and what it makes of an unknown axle's place
constexpr double kBiasBlock = 1.0;              ///< s of standing gyro mean per bias update
constexpr double kFirstBiasGate = 6.6;  ///< squared sigma, 99 %, of a standstill's first mean: beyond is turning
constexpr double kBiasGate = 25.0;      ///< of the later ones, of which there may be hundreds

bool usable(const ImuSample& imu) {
  return imu.gyro.cwiseAbs().maxCoeff() < kLargestRate && imu.accel.cwiseAbs().maxCoeff() < kLargestForce &&
         imu.gyro.allFinite() && imu.accel.allFinite();
}

}  // namespace

WheelOdometry::WheelOdometry(const WheelConfig& config) : config_(config) {}

bool WheelOdometry::yaw_from_wheels() const {
  const YawSource source = config_.tuning.yaw_source;
  return source == YawSource::kVehicleSensor || source == YawSource::kWheelSides;
}

WheelNoise WheelOdometry::imu_noise() const {
  const WheelSensors& s = config_.sensors;
  const WheelTuning& t = config_.tuning;
  WheelNoise noise{s.gyro_noise,     std::hypot(s.accel_noise, t.accel_disturbance),
                   s.gyro_bias_walk, s.accel_bias_walk,
                   t.side_noise,     t.climb_noise};
  if (!t.correct_acceleration) noise.accel = std::max(noise.accel, kPlainDisturbance);
  return noise;
}

WheelInputStatus WheelOdometry::add(const ImuSample& imu) {
  if (!usable(imu)) return WheelInputStatus::kBadValue;
  if (imu_us_ && imu.t_us <= *imu_us_) return WheelInputStatus::kOld;
  if (!first_us_) first_us_ = imu.t_us;
  if (!started_) return align(imu);
  if (imu.t_us <= t_us_) return WheelInputStatus::kOld;
  imu_us_ = imu.t_us;
  const double dt = seconds_between(t_us_, imu.t_us);
  const Eigen::Vector3d gyro_before = std::exchange(gyro_, imu.gyro);
  if (dt > config_.tuning.imu_timeout) {
    step_blind(imu.t_us, 0.0);
    return WheelInputStatus::kUsed;
  }
  use_yaw_source(!yaw_from_wheels());
  gather_plumb(imu, dt);
  WheelStep next;
  next.dt = dt;
  next.gyro = imu.gyro;
  if (!gyro_yaw_) next.gyro.z() = wheel_yaw_rate_.value_or(0.0);
  const WheelSensors& s = config_.sensors;
  const Eigen::Vector3d omega = imu.gyro - state_.x.segment<3>(kGyroBias);
  next.accel = imu.accel + lever_acceleration(s.p_imu_axle, omega, (imu.gyro - gyro_before) / dt);
  WheelNoise noise = imu_noise();
  noise.accel = std::hypot(noise.accel, std::sqrt(kTurnTime) * omega.squaredNorm() * s.p_imu_axle_std.x());
  next.standing = standing_.standing;
  next.turning = turns_standing_;
  next.form = config_.tuning.step_form;
  const double speed = state_.x(kSpeed);
  step(imu.t_us, next, noise);
  forward_acceleration_ = next.standing ? 0.0 : (state_.x(kSpeed) - speed) / dt;
  const StandingLimits limits{config_.tuning.standing_speed, config_.tuning.standing_rate,
                              config_.tuning.standing_after};
  add_gyro(standing_, limits, dt, imu.gyro);
  if (next.standing) learn_bias(next);
  if (!config_.tuning.correct_acceleration && plumb_time_ >= kPlainLevelling) level_by_plumb(0.0);
  return WheelInputStatus::kUsed;
}

WheelInputStatus WheelOdometry::align(const ImuSample& imu) {
  if (imu_us_) gather_plumb(imu, std::min(seconds_between(*imu_us_, imu.t_us), config_.tuning.imu_timeout));
  imu_us_ = imu.t_us;
  t_us_ = imu.t_us;
  gyro_ = imu.gyro;
  standing_.slow_gyro = imu.gyro;
  return WheelInputStatus::kAligning;
}

void WheelOdometry::gather_plumb(const ImuSample& imu, double dt_s) {
  plumb_force_ += dt_s * imu.accel;
  plumb_gyro_ += dt_s * imu.gyro;
  plumb_time_ += dt_s;
}

/// Starts once the corrected force of enough intervals between wheel samples is there.
void WheelOdometry::align_by_plumb(double speed_rate) {
  if (plumb_time_ > 0.0 && plumb_time_ < config_.tuning.wheel_timeout) {
    align_force_ += plumb_force_;
    if (config_.tuning.correct_acceleration)
      align_force_ -= plumb_time_ * wheel_acceleration(last_speed_, speed_rate, plumb_gyro_ / plumb_time_,
                                                       travel_direction(config_.sensors.side, config_.sensors.climb));
    align_time_ += plumb_time_;
  }
  forget_plumb();
  if (align_time_ == 0.0 || align_time_ < config_.tuning.align_time) return;
  start(tilt_of_gravity(align_force_), imu_noise().accel / std::sqrt(align_time_) / kStandardGravity);
}

/// Speeds in whole steps, as many buses carry them, differ by one step at least. Others differ by next to nothing soon.
void WheelOdometry::watch_resolution(double speed) {
  const double change = std::abs(speed - std::exchange(raw_speed_, speed));
  if (change < kSameSpeed) return;
  smallest_change_ = num_changes_ == 0 ? change : std::min(change, smallest_change_);
  num_changes_ = std::min(num_changes_ + 1, kChangesEnough);
}

/// Of one sample, with what rounding adds.
double WheelOdometry::wheel_noise() const { return std::hypot(config_.sensors.wheel_noise, rounding_noise(kRounding)); }

/// Of one of many samples dt_s apart, (M.26a): a rounding error stays while the speed does.
double WheelOdometry::rounding_noise(double dt_s) const {
  if (num_changes_ < kChangesEnough) return 0.0;
  return smallest_change_ * std::sqrt(std::max(1.0, kRounding / dt_s) / 12.0);
}

/// The newest wheel sample ends an interval once it is long enough for the wheels' noise, (M.5a).
void WheelOdometry::level_by_wheels(std::optional<int64_t> last_us, int64_t t_us, bool slipping) {
  const bool gap = !last_us || seconds_between(*last_us, t_us) >= config_.tuning.wheel_timeout;
  if (slipping || gap) forget_plumb();
  if (plumb_begin_us_) {
    const double dt = seconds_between(*plumb_begin_us_, t_us);
    if (dt < std::sqrt(2.0) * wheel_noise() / kSpeedRateNoise) return;
    level_by_plumb((last_speed_ - plumb_begin_speed_) / dt);
  }
  plumb_begin_us_ = t_us;
  plumb_begin_speed_ = last_speed_;
  plumb_begin_gyro_ = gyro_;
}

/// Acceleration of the axle less the imu's, by the place of the axle: what the turning of the interval makes of it.
Eigen::Matrix3d WheelOdometry::lever_by_turning() const {
  if (!plumb_begin_us_) return Eigen::Matrix3d::Zero();
  const Eigen::Vector3d omega = plumb_gyro_ / plumb_time_ - state_.x.segment<3>(kGyroBias);
  const Eigen::Vector3d omega_rate = (gyro_ - plumb_begin_gyro_) / plumb_time_;
  Eigen::Matrix3d by_place;
  for (int i = 0; i < 3; ++i) by_place.col(i) = lever_acceleration(Eigen::Vector3d::Unit(i), omega, omega_rate);
  return by_place;
}

void WheelOdometry::level_by_plumb(double speed_rate) {
  const WheelTuning& t = config_.tuning;
  if (plumb_time_ > 0.0 && !slip_since_us_) {
    PlumbLine plumb;
    // The force that the axle feels, as far as it is known where it is.
    const Eigen::Matrix3d by_place = lever_by_turning();
    plumb.force = plumb_force_ / plumb_time_ + by_place * config_.sensors.p_imu_axle;
    plumb.gyro = plumb_gyro_ / plumb_time_;
    plumb.speed_rate = standing_.standing ? 0.0 : speed_rate;
    plumb.correct_acceleration = t.correct_acceleration;
    plumb.share = accelerometer_share(plumb_time_, t.tilt_time_constant);
    // The wheels' noise telescopes in the sum of their differences: (M.6) gives what is left of it.
    const double white = imu_noise().accel / std::sqrt(plumb_time_);
    const double wheels = wheel_noise() * std::sqrt(2.0 / (plumb_time_ * t.tilt_time_constant));
    const double off_g = std::abs(plumb_force(state_.x, plumb).norm() - kStandardGravity);
    if (!plumb.correct_acceleration || off_g < t.tilt_gate)
      level(state_, plumb, std::hypot(white, wheels, (by_place * config_.sensors.p_imu_axle_std.asDiagonal()).norm()));
  }
  forget_plumb();
}

void WheelOdometry::forget_plumb() {
  plumb_force_.setZero();
  plumb_gyro_.setZero();
  plumb_time_ = 0.0;
  plumb_begin_us_.reset();
}

void WheelOdometry::start(const Tilt& tilt, double tilt_sigma) {
  const WheelSensors& s = config_.sensors;
  state_ = WheelState{};
  WheelCovariance& P = state_.P;
  state_.x(kRoll) = tilt.roll;
  state_.x(kPitch) = tilt.pitch;
  for (int i = 0; i < 3; ++i) {
    decouple(P, kGyroBias + i, recalled_ ? known_.gyro_bias_sigma(i) : s.gyro_bias_std);
    state_.x(kGyroBias + i) = known_.gyro_bias(i);
  }
  for (int i = 0; i < 2; ++i) decouple(P, kAccelBias + i, s.accel_bias_std);
  state_.x(kSide) = s.side;
  state_.x(kClimb) = s.climb;
  decouple(P, kWheelScale, s.wheel_scale_std);
  decouple(P, kSide, s.mounting_std.z());
  decouple(P, kClimb, s.mounting_std.y());
  decouple(P, kGyroScale, s.gyro_scale_std);
  // roll and pitch came from the biased accelerometer: (M.4) at the level, roll by y, pitch by -x.
  const double by_bias = 1.0 / kStandardGravity, bias_variance = s.accel_bias_std * s.accel_bias_std;
  P(kRoll, kRoll) = tilt_sigma * tilt_sigma + by_bias * by_bias * bias_variance;
  P(kPitch, kPitch) = P(kRoll, kRoll);
  P(kRoll, kAccelBias + 1) = P(kAccelBias + 1, kRoll) = -by_bias * bias_variance;
  P(kPitch, kAccelBias) = P(kAccelBias, kPitch) = by_bias * bias_variance;
  // The speed came from one wheel sample.
  state_.x(kSpeed) = last_speed_;
  const double scale_variance = s.wheel_scale_std * s.wheel_scale_std;
  const bool sign_open = direction_.undecided_since_us.has_value();
  P(kSpeed, kSpeed) = s.wheel_noise * s.wheel_noise + last_speed_ * last_speed_ * (sign_open ? 4.0 : scale_variance);
  P(kSpeed, kWheelScale) = P(kWheelScale, kSpeed) = last_speed_ * scale_variance;
  started_ = true;
}

void WheelOdometry::step(int64_t t_us, const WheelStep& next, const WheelNoise& noise) {
  propagate(state_, next, noise);
  t_us_ = t_us;
}

/// Carries the state to t_us without an imu: with the wheels' acceleration, turning as the wheels or the last gyro say.
void WheelOdometry::step_blind(int64_t t_us, double acceleration) {
  WheelStep next;
  next.dt = seconds_between(t_us_, t_us);
  next.blind_acceleration = standing_.standing ? 0.0 : acceleration;
  next.form = config_.tuning.step_form;
  next.standing = standing_.standing;
  yaw_known_ = wheel_yaw_rate_.has_value();
  if (yaw_known_) use_yaw_source(false);
  const bool recent = imu_us_ && seconds_between(*imu_us_, t_us) < config_.tuning.restart_gap;
  const double rate = wheel_yaw_rate_.value_or(recent && gyro_yaw_ ? gyro_.z() : state_.x(kGyroBias + 2));
  next.gyro = state_.x.segment<3>(kGyroBias);
  next.gyro.z() = rate;
  WheelNoise noise = imu_noise();
  noise.accel = kUnknownAcceleration;
  noise.gyro = yaw_known_ ? config_.sensors.wheel_yaw_noise * std::sqrt(next.dt) : kUnknownRate;
  if (next.dt > config_.tuning.restart_gap) ++reset_counter_;
  step(t_us, next, noise);
  // Roll and pitch follow the road within its slopes, they do not wander off.
  for (const int i : {int{kRoll}, int{kPitch}})
    if (state_.sigma(i) > kUnknownTilt) decouple(state_.P, i, kUnknownTilt);
  forward_acceleration_ = 0.0;
  forget_plumb();
}

void WheelOdometry::use_yaw_source(bool gyro) {
  if (gyro) yaw_known_ = true;
  if (gyro == gyro_yaw_) return;
  gyro_yaw_ = gyro;
  const WheelSensors& s = config_.sensors;
  state_.x(kGyroBias + 2) = 0.0;
  decouple(state_.P, kGyroBias + 2, gyro ? s.gyro_bias_std : s.wheel_yaw_bias_std);
}

void WheelOdometry::learn_bias(const WheelStep& standing_step) {
  block_gyro_ += standing_step.dt * standing_step.gyro;
  block_time_ += standing_step.dt;
  if (block_time_ < kBiasBlock) return;
  const double variance = config_.sensors.gyro_noise * config_.sensors.gyro_noise / block_time_;
  const Eigen::Vector3d difference = block_gyro_ / block_time_ - state_.x.segment<3>(kGyroBias);
  for (int i = 0; i < 3; ++i) {
    const double d = difference(i), S = state_.P(kGyroBias + i, kGyroBias + i) + variance;
    const bool no_bias = d * d > (bias_judged_ ? kBiasGate : kFirstBiasGate) * S;
    if (i == 2 && no_bias) turns_standing_ = true;
    if (no_bias || (i == 2 && turns_standing_)) continue;
    WheelVector H = WheelVector::Zero();
    H(kGyroBias + i) = 1.0;
    schmidt_update(state_, H, d, variance, {kGyroBias + i});
  }
  bias_judged_ = true;
  block_gyro_.setZero();
  block_time_ = 0.0;
}

}  // namespace roadfix
