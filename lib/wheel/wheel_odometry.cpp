#include "wheel/wheel_odometry.h"

#include <cmath>
#include <utility>

#include "geometry/so3.h"
#include "wheel/axle_motion.h"

namespace roadfix {

using namespace wheel;  // indices of the error state
namespace {

constexpr double kLargestRate = 35.0;            ///< rad/s, full scale of automotive gyros
constexpr double kLargestForce = 400.0;          ///< m/s2, full scale of accelerometers
constexpr double kUnknownTilt = 3.0 * kDegree;   ///< road cross fall and gradient, without an accelerometer
constexpr double kUnknownAcceleration = 1.5;     ///< m/s2 per sqrt(Hz): 1.5 m/s2 for a second
constexpr double kUnknownRate = 0.1;             ///< rad/s per sqrt(Hz): a street corner within a few seconds
constexpr double kUncorrectedDisturbance = 3.0;  ///< m/s2 per sqrt(Hz): 1.5 m/s2 over 2 s, vehicle acceleration
                                                 ///< not corrected
constexpr double kUncorrectedLevelling = 0.05;   ///< s of specific force per tilt correction without wheels
constexpr double kSpeedRateNoise = 0.2;          ///< m/s2, wheel noise admitted in one tilt correction, a fifth of its
                                                 ///< gate
constexpr double kMinSpeedChange = 1e-6;         ///< m/s, smaller differences count as equal speeds
constexpr int kMinChanges = 20;                  ///< number of speed changes before the resolution is estimated
constexpr double kRoundingCorrelation = 1.0;     ///< s, correlation time of the rounding error
constexpr double kTurnDuration = 3.0;            ///< s, typical duration of a turn, for the error of an uncertain
                                                 ///< lever arm
constexpr double kBiasBlock = 1.0;               ///< s of gyro mean per bias update at standstill
constexpr double kFirstBiasGate = 6.6;  ///< squared sigma, 99 %, first mean of a standstill: beyond it the vehicle
                                        ///< turns
constexpr double kBiasGate = 25.0;      ///< squared sigma, later means, of which there may be hundreds

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
                   t.sideslip_noise, t.heave_noise};
  if (!t.correct_acceleration) noise.accel = std::max(noise.accel, kUncorrectedDisturbance);
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
    propagate_without_imu(imu.t_us, 0.0);
    return WheelInputStatus::kUsed;
  }
  use_yaw_source(!yaw_from_wheels());
  accumulate_levelling(imu, dt);
  WheelStep next;
  next.dt = dt;
  next.gyro = imu.gyro;
  if (!gyro_yaw_) next.gyro.z() = wheel_yaw_rate_.value_or(0.0);
  const WheelSensors& s = config_.sensors;
  const Eigen::Vector3d omega = imu.gyro - state_.x.segment<3>(kGyroBias);
  next.accel = imu.accel + lever_arm_acceleration(s.p_imu_axle, omega, (imu.gyro - gyro_before) / dt);
  WheelNoise noise = imu_noise();
  noise.accel = std::hypot(noise.accel, std::sqrt(kTurnDuration) * omega.squaredNorm() * s.p_imu_axle_std.x());
  next.standing = standstill_.standing;
  next.turning = turning_at_standstill_;
  next.form = config_.tuning.step_form;
  const double speed = state_.x(kSpeed);
  step(imu.t_us, next, noise);
  forward_acceleration_ = next.standing ? 0.0 : (state_.x(kSpeed) - speed) / dt;
  const StandstillLimits limits{config_.tuning.standing_speed, config_.tuning.standing_rate,
                                config_.tuning.standing_after};
  add_gyro(standstill_, limits, dt, imu.gyro);
  if (next.standing) update_gyro_bias(next);
  if (!config_.tuning.correct_acceleration && levelling_time_ >= kUncorrectedLevelling) level_by_accelerometer(0.0);
  return WheelInputStatus::kUsed;
}

WheelInputStatus WheelOdometry::align(const ImuSample& imu) {
  if (imu_us_) accumulate_levelling(imu, std::min(seconds_between(*imu_us_, imu.t_us), config_.tuning.imu_timeout));
  imu_us_ = imu.t_us;
  t_us_ = imu.t_us;
  gyro_ = imu.gyro;
  standstill_.filtered_gyro = imu.gyro;
  return WheelInputStatus::kAligning;
}

void WheelOdometry::accumulate_levelling(const ImuSample& imu, double dt_s) {
  levelling_force_ += dt_s * imu.accel;
  levelling_gyro_ += dt_s * imu.gyro;
  levelling_time_ += dt_s;
}

/// Starts once enough corrected specific force has been accumulated between wheel samples.
void WheelOdometry::align_by_accelerometer(double speed_rate) {
  if (levelling_time_ > 0.0 && levelling_time_ < config_.tuning.wheel_timeout) {
    align_force_ += levelling_force_;
    if (config_.tuning.correct_acceleration)
      align_force_ -= levelling_time_ *
                      axle_acceleration(last_speed_, speed_rate, levelling_gyro_ / levelling_time_,
                                        travel_direction(config_.sensors.mounting_yaw, config_.sensors.mounting_pitch));
    align_time_ += levelling_time_;
  }
  reset_levelling();
  if (align_time_ == 0.0 || align_time_ < config_.tuning.align_time) return;
  start(tilt_of_gravity(align_force_), imu_noise().accel / std::sqrt(align_time_) / kStandardGravity);
}

/// Quantised speeds, as many buses carry them, differ by at least one step; others soon differ by almost nothing.
void WheelOdometry::estimate_resolution(double speed) {
  const double change = std::abs(speed - std::exchange(raw_speed_, speed));
  if (change < kMinSpeedChange) return;
  smallest_change_ = num_changes_ == 0 ? change : std::min(change, smallest_change_);
  num_changes_ = std::min(num_changes_ + 1, kMinChanges);
}

/// Noise of one sample, rounding included.
double WheelOdometry::wheel_noise() const {
  return std::hypot(config_.sensors.wheel_noise, rounding_noise(kRoundingCorrelation));
}

/// Rounding noise of one of many samples dt_s apart, (W.6.3): the rounding error is constant while the speed is.
double WheelOdometry::rounding_noise(double dt_s) const {
  if (num_changes_ < kMinChanges) return 0.0;
  return smallest_change_ * std::sqrt(std::max(1.0, kRoundingCorrelation / dt_s) / 12.0);
}

/// A wheel sample ends the interval once it is long enough for the wheel noise, (W.1.8).
void WheelOdometry::level_by_wheels(std::optional<int64_t> last_us, int64_t t_us, bool slipping) {
  const bool gap = !last_us || seconds_between(*last_us, t_us) >= config_.tuning.wheel_timeout;
  if (slipping || gap) reset_levelling();
  if (levelling_begin_us_) {
    const double dt = seconds_between(*levelling_begin_us_, t_us);
    if (dt < std::sqrt(2.0) * wheel_noise() / kSpeedRateNoise) return;
    level_by_accelerometer((last_speed_ - levelling_begin_speed_) / dt);
  }
  levelling_begin_us_ = t_us;
  levelling_begin_speed_ = last_speed_;
  levelling_begin_gyro_ = gyro_;
}

/// Derivative of the acceleration difference between axle and IMU by the lever arm.
Eigen::Matrix3d WheelOdometry::lever_arm_jacobian() const {
  if (!levelling_begin_us_) return Eigen::Matrix3d::Zero();
  const Eigen::Vector3d omega = levelling_gyro_ / levelling_time_ - state_.x.segment<3>(kGyroBias);
  const Eigen::Vector3d omega_rate = (gyro_ - levelling_begin_gyro_) / levelling_time_;
  Eigen::Matrix3d by_lever_arm;
  for (int i = 0; i < 3; ++i) by_lever_arm.col(i) = lever_arm_acceleration(Eigen::Vector3d::Unit(i), omega, omega_rate);
  return by_lever_arm;
}

void WheelOdometry::level_by_accelerometer(double speed_rate) {
  const WheelTuning& t = config_.tuning;
  if (levelling_time_ > 0.0 && !slip_since_us_) {
    GravityMeasurement gravity;
    // Specific force at the axle, with the calibrated lever arm.
    const Eigen::Matrix3d by_lever_arm = lever_arm_jacobian();
    gravity.force = levelling_force_ / levelling_time_ + by_lever_arm * config_.sensors.p_imu_axle;
    gravity.gyro = levelling_gyro_ / levelling_time_;
    gravity.speed_rate = standstill_.standing ? 0.0 : speed_rate;
    gravity.correct_acceleration = t.correct_acceleration;
    gravity.share = accelerometer_share(levelling_time_, t.tilt_time_constant);
    // The wheel noise telescopes in the sum of differences; (W.1.7) is what remains.
    const double white = imu_noise().accel / std::sqrt(levelling_time_);
    const double wheels = wheel_noise() * std::sqrt(2.0 / (levelling_time_ * t.tilt_time_constant));
    const double off_g = std::abs(gravity_reaction(state_.x, gravity).norm() - kStandardGravity);
    if (!gravity.correct_acceleration || off_g < t.tilt_gate)
      update_tilt(state_, gravity,
                  std::hypot(white, wheels, (by_lever_arm * config_.sensors.p_imu_axle_std.asDiagonal()).norm()));
  }
  reset_levelling();
}

void WheelOdometry::reset_levelling() {
  levelling_force_.setZero();
  levelling_gyro_.setZero();
  levelling_time_ = 0.0;
  levelling_begin_us_.reset();
}

void WheelOdometry::start(const Tilt& tilt, double tilt_sigma) {
  const WheelSensors& s = config_.sensors;
  state_ = WheelState{};
  WheelCovariance& P = state_.P;
  state_.x(kRoll) = tilt.roll;
  state_.x(kPitch) = tilt.pitch;
  for (int i = 0; i < 3; ++i) {
    decouple(P, kGyroBias + i, restored_ ? prior_.gyro_bias_sigma(i) : s.gyro_bias_std);
    state_.x(kGyroBias + i) = prior_.gyro_bias(i);
  }
  for (int i = 0; i < 2; ++i) decouple(P, kAccelBias + i, s.accel_bias_std);
  state_.x(kMountingYaw) = s.mounting_yaw;
  state_.x(kMountingPitch) = s.mounting_pitch;
  decouple(P, kWheelScale, s.wheel_scale_std);
  decouple(P, kMountingYaw, s.mounting_std.z());
  decouple(P, kMountingPitch, s.mounting_std.y());
  decouple(P, kGyroScale, s.gyro_scale_std);
  // Roll and pitch come from the biased accelerometer: (W.1.5) at zero tilt, roll by y, pitch by -x.
  const double by_bias = 1.0 / kStandardGravity, bias_variance = s.accel_bias_std * s.accel_bias_std;
  P(kRoll, kRoll) = tilt_sigma * tilt_sigma + by_bias * by_bias * bias_variance;
  P(kPitch, kPitch) = P(kRoll, kRoll);
  P(kRoll, kAccelBias + 1) = P(kAccelBias + 1, kRoll) = -by_bias * bias_variance;
  P(kPitch, kAccelBias) = P(kAccelBias, kPitch) = by_bias * bias_variance;
  // The speed comes from one wheel sample.
  state_.x(kSpeed) = last_speed_;
  const double scale_variance = s.wheel_scale_std * s.wheel_scale_std;
  const bool sign_unknown = direction_.undecided_since_us.has_value();
  P(kSpeed, kSpeed) = s.wheel_noise * s.wheel_noise + last_speed_ * last_speed_ * (sign_unknown ? 4.0 : scale_variance);
  P(kSpeed, kWheelScale) = P(kWheelScale, kSpeed) = last_speed_ * scale_variance;
  started_ = true;
}

void WheelOdometry::step(int64_t t_us, const WheelStep& next, const WheelNoise& noise) {
  propagate(state_, next, noise);
  t_us_ = t_us;
}

/// Propagates to t_us without an IMU sample: acceleration from the wheels, yaw rate from the wheels or the last gyro
/// value.
void WheelOdometry::propagate_without_imu(int64_t t_us, double acceleration) {
  WheelStep next;
  next.dt = seconds_between(t_us_, t_us);
  next.assumed_acceleration = standstill_.standing ? 0.0 : acceleration;
  next.form = config_.tuning.step_form;
  next.standing = standstill_.standing;
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
  // Without an IMU, roll and pitch are bounded by road gradients.
  for (const int i : {int{kRoll}, int{kPitch}})
    if (state_.sigma(i) > kUnknownTilt) decouple(state_.P, i, kUnknownTilt);
  forward_acceleration_ = 0.0;
  reset_levelling();
}

void WheelOdometry::use_yaw_source(bool gyro) {
  if (gyro) yaw_known_ = true;
  if (gyro == gyro_yaw_) return;
  gyro_yaw_ = gyro;
  const WheelSensors& s = config_.sensors;
  state_.x(kGyroBias + 2) = 0.0;
  decouple(state_.P, kGyroBias + 2, gyro ? s.gyro_bias_std : s.wheel_yaw_bias_std);
}

void WheelOdometry::update_gyro_bias(const WheelStep& standing_step) {
  block_gyro_ += standing_step.dt * standing_step.gyro;
  block_time_ += standing_step.dt;
  if (block_time_ < kBiasBlock) return;
  const double variance = config_.sensors.gyro_noise * config_.sensors.gyro_noise / block_time_;
  const Eigen::Vector3d difference = block_gyro_ / block_time_ - state_.x.segment<3>(kGyroBias);
  for (int i = 0; i < 3; ++i) {
    const double d = difference(i), S = state_.P(kGyroBias + i, kGyroBias + i) + variance;
    const bool no_bias = d * d > (bias_tested_ ? kBiasGate : kFirstBiasGate) * S;
    if (i == 2 && no_bias) turning_at_standstill_ = true;
    if (no_bias || (i == 2 && turning_at_standstill_)) continue;
    WheelVector H = WheelVector::Zero();
    H(kGyroBias + i) = 1.0;
    schmidt_update(state_, H, d, variance, {kGyroBias + i});
  }
  bias_tested_ = true;
  block_gyro_.setZero();
  block_time_ = 0.0;
}

}  // namespace roadfix
