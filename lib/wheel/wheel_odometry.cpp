#include "wheel/wheel_odometry.h"

#include <cmath>
#include <utility>

#include "wheel/axle_motion.h"
#include "wheel/wheel_kinematics.h"
#include "wheel/wheel_output.h"

namespace roadfix {

using namespace wheel;  // indices of the error state
namespace {

constexpr double kLargestRate = 35.0;         ///< rad/s, full scale of automotive gyros, beyond any car
constexpr double kLargestForce = 400.0;       ///< m/s2, full scale of accelerometers
constexpr double kUnknownAcceleration = 1.5;  ///< m/s2 per sqrt(Hz): 1.5 m/s2 for a second
constexpr double kUnknownRate = 0.1;          ///< rad/s per sqrt(Hz): a street corner within a few seconds
constexpr double kLostSpeedSigma = 3.0;       ///< m/s: the speed is lost
constexpr double kLostYawSigma = 0.8;         ///< rad: the yaw is lost

bool usable(const ImuSample& imu) {
  return imu.gyro.cwiseAbs().maxCoeff() < kLargestRate && imu.accel.cwiseAbs().maxCoeff() < kLargestForce &&
         imu.gyro.allFinite() && imu.accel.allFinite();
}

}  // namespace

WheelOdometry::WheelOdometry(const WheelConfig& config)
    : config_(config),
      alignment_(config),
      yaw_rate_(config),
      speed_(config),
      standstill_(config),
      levelling_(config),
      heading_(config) {}

WheelInputStatus WheelOdometry::add(const ImuSample& imu) {
  if (!usable(imu)) return WheelInputStatus::kBadValue;
  if (imu_.t_us && imu.t_us <= *imu_.t_us) return WheelInputStatus::kOld;
  if (!started_) return align(imu);
  if (imu.t_us <= state_.t_us) return WheelInputStatus::kOld;
  const NewestImu before = std::exchange(imu_, {imu.t_us, imu.gyro});
  const double dt = seconds_between(state_.t_us, imu.t_us);
  if (dt > config_.tuning.imu_timeout) {
    propagate_without_imu(imu.t_us, 0.0);
    return WheelInputStatus::kUsed;
  }
  yaw_rate_.select_with_imu(state_);
  levelling_.add(imu, dt);
  propagate_by_imu(imu, before.gyro);
  standstill_.add_imu(state_, imu, dt, yaw_rate_.rate(imu.gyro));
  if (!config_.tuning.correct_acceleration) levelling_.add_uncorrected(state_, imu.gyro, levelling_motion());
  return WheelInputStatus::kUsed;
}

WheelInputStatus WheelOdometry::add(const WheelSample& wheels) {
  const std::optional<WheelMotion> motion = wheel_motion(wheels, config_.sensors.track_width, config_.tuning.side_rule);
  if (!motion || (wheels.yaw_rate && !(std::abs(*wheels.yaw_rate) < kLargestRate))) return WheelInputStatus::kBadValue;
  if (wheels_.t_us && wheels.t_us <= *wheels_.t_us) return WheelInputStatus::kOld;
  if (!first_wheels_us_) first_wheels_us_ = wheels.t_us;
  const WheelSpeed z{wheels.t_us, motion->speed, wheels.direction == WheelDirection::kUnknown};
  yaw_rate_.add(*motion);
  speed_.observe(wheels);
  return started_ ? update(z) : align(z);
}

WheelInputStatus WheelOdometry::add(const MagSample& mag) {
  if (!config_.tuning.use_mag) return WheelInputStatus::kDisabled;
  if (!mag.field.allFinite()) return WheelInputStatus::kBadValue;
  if (!started_) return WheelInputStatus::kAligning;
  return heading_.update(state_, mag, imu_.gyro.z() - state_.x(kGyroBias + 2), standstill_.standing());
}

WheelInputStatus WheelOdometry::align(const ImuSample& imu) {
  if (imu_.t_us) levelling_.add(imu, std::min(seconds_between(*imu_.t_us, imu.t_us), config_.tuning.imu_timeout));
  imu_ = {imu.t_us, imu.gyro};
  state_.t_us = imu.t_us;
  return WheelInputStatus::kAligning;
}

WheelInputStatus WheelOdometry::align(const WheelSpeed& z) {
  speed_.await_direction(z);
  const NewestWheels before = std::exchange(wheels_, {z.t_us, z.value});
  const InitialSpeed speed{z.value, speed_.direction().undecided_since_us.has_value()};
  if (imu_silent(z.t_us)) {
    start(alignment_.level(z.t_us, speed));
    return WheelInputStatus::kUsed;
  }
  if (before.t_us)
    alignment_.add(levelling_.integral(), z.value, (z.value - before.speed) / seconds_between(*before.t_us, z.t_us));
  levelling_.reset();
  if (!alignment_.complete()) return WheelInputStatus::kAligning;
  start(alignment_.levelled(*imu_.t_us, speed));
  return WheelInputStatus::kUsed;
}

void WheelOdometry::start(const WheelState& first) {
  state_ = first;
  started_ = true;
}

WheelInputStatus WheelOdometry::update(const WheelSpeed& z) {
  const double speed = speed_.signed_speed(z);
  if (imu_silent(z.t_us) && z.t_us > state_.t_us) {
    const double gain = speed_.sign_unknown(z) ? 0.0 : speed - state_.x(kSpeed);
    propagate_without_imu(z.t_us, gain / seconds_between(state_.t_us, z.t_us));
  }
  const NewestWheels before = std::exchange(wheels_, {z.t_us, speed});
  const double dt = seconds_between(*before.t_us, z.t_us);
  const WheelInputStatus status = speed_.update(state_, z, forward_acceleration_, dt);
  if (config_.tuning.correct_acceleration) level_by_wheels(dt);
  if (standstill_.add_speed(state_, z.t_us, z.value, !speed_.slipping())) speed_.forget_direction();
  return status;
}

void WheelOdometry::propagate_by_imu(const ImuSample& imu, const Eigen::Vector3d& gyro_before) {
  const Eigen::Vector3d omega = imu.gyro - state_.x.segment<3>(kGyroBias);
  WheelStep step;
  step.dt = seconds_between(state_.t_us, imu.t_us);
  step.gyro = yaw_rate_.rate(imu.gyro);
  step.accel =
      imu.accel + lever_arm_acceleration(config_.sensors.p_imu_axle, omega, (imu.gyro - gyro_before) / step.dt);
  step.standing = standstill_.standing();
  step.turning = standstill_.turning();
  step.form = config_.tuning.step_form;
  const double speed = state_.x(kSpeed);
  propagate(state_, step, process_noise(config_));
  state_.t_us = imu.t_us;
  forward_acceleration_ = step.standing ? 0.0 : (state_.x(kSpeed) - speed) / step.dt;
}

/// Propagates to t_us without an IMU sample: acceleration from the wheels, yaw rate from the wheels or the last gyro
/// value.
void WheelOdometry::propagate_without_imu(int64_t t_us, double acceleration) {
  yaw_rate_.select_without_imu(state_);
  const bool recent = imu_.t_us && seconds_between(*imu_.t_us, t_us) < config_.tuning.restart_gap;
  const Eigen::Vector3d bias = state_.x.segment<3>(kGyroBias);
  WheelStep step;
  step.dt = seconds_between(state_.t_us, t_us);
  step.gyro = bias;
  step.gyro.z() = yaw_rate_.wheel_rate().value_or(recent && yaw_rate_.is_gyro() ? imu_.gyro.z() : bias.z());
  step.standing = standstill_.standing();
  step.assumed_acceleration = step.standing ? 0.0 : acceleration;
  step.form = config_.tuning.step_form;
  WheelNoise noise = process_noise(config_);
  noise.accel = kUnknownAcceleration;
  noise.gyro = yaw_rate_.known() ? config_.sensors.wheel_yaw_noise * std::sqrt(step.dt) : kUnknownRate;
  if (step.dt > config_.tuning.restart_gap) ++reset_counter_;
  propagate(state_, step, noise);
  state_.t_us = t_us;
  // Without an IMU, roll and pitch are bounded by road gradients.
  for (const int i : {int{kRoll}, int{kPitch}})
    if (state_.sigma(i) > kRoadTilt) decouple(state_.P, i, kRoadTilt);
  forward_acceleration_ = 0.0;
  levelling_.reset();
}

/// `dt_s`: since the wheel sample before.
void WheelOdometry::level_by_wheels(double dt_s) {
  if (dt_s >= config_.tuning.wheel_timeout) levelling_.reset();
  levelling_.add(state_, {wheels_.t_us, wheels_.speed, imu_.gyro}, levelling_motion());
}

LevellingMotion WheelOdometry::levelling_motion() const {
  return {speed_.sigma_of_one(), standstill_.standing(), speed_.slipping()};
}

/// Before the first IMU sample: since the first wheel sample.
bool WheelOdometry::imu_silent(int64_t t_us) const {
  return seconds_between(imu_.t_us.value_or(first_wheels_us_.value_or(t_us)), t_us) > config_.tuning.imu_timeout;
}

Odometry WheelOdometry::odometry() const {
  if (!started_) {
    Odometry none;
    none.t_us = state_.t_us;
    return none;
  }
  const Eigen::Vector3d rate = yaw_rate_.rate(imu_.gyro) - state_.x.segment<3>(kGyroBias);
  Odometry out = wheel_output(state_, config_, standstill_.standing() ? Eigen::Vector3d::Zero() : rate);
  out.validity = report().validity;
  return out;
}

WheelReport WheelOdometry::report() const {
  WheelReport r;
  r.reset_counter = reset_counter_;
  r.standing = standstill_.standing();
  r.slipping = speed_.slipping();
  if (!started_) {
    r.phase = wheels_.t_us && imu_.t_us ? WheelPhase::kAligning : WheelPhase::kWaiting;
    r.reason = !wheels_.t_us ? "waits for wheels" : (!imu_.t_us ? "waits for imu" : "levels by the accelerometer");
    return r;
  }
  const auto weak = [&](const char* reason) {
    r.phase = WheelPhase::kWeak;
    r.validity = Validity::kCoasting;
    r.reason = reason;
  };
  r.phase = WheelPhase::kRunning;
  r.validity = Validity::kValid;
  if (imu_silent(state_.t_us) && yaw_rate_.known()) weak("no imu: level road assumed, yaw rate from the wheels");
  if (speed_.direction().assumed) weak("direction unknown, forward assumed");
  if (speed_.direction().undecided_since_us) weak("direction unknown");
  if (r.slipping) weak("wheels slip: speed from the accelerometer");
  if (seconds_between(*wheels_.t_us, state_.t_us) > config_.tuning.wheel_timeout)
    weak("no wheels: speed from the accelerometer");
  if (!yaw_rate_.known()) weak("no yaw rate: neither imu nor wheels tell it");
  if (state_.sigma(kSpeed) > kLostSpeedSigma || state_.sigma(kYaw) > kLostYawSigma) {
    r.phase = WheelPhase::kLost;
    r.validity = Validity::kInvalid;
    r.reason += r.reason.empty() ? "uncertainty too large" : "; uncertainty too large";
  }
  return r;
}

std::optional<WheelMemory> WheelOdometry::memory() const {
  WheelMemory memory;
  for (int i = 0; i < 3; ++i) memory.gyro_bias_sigma(i) = state_.sigma(kGyroBias + i);
  if (!started_ || memory.gyro_bias_sigma.maxCoeff() > 0.5 * config_.sensors.gyro_bias_std) return std::nullopt;
  memory.gyro_bias = state_.x.segment<3>(kGyroBias);
  return memory;
}

template <class Archive>
void WheelOdometry::serialise(Archive& a) {
  a(state_.t_us, state_.x, state_.P, started_);
  a(imu_.t_us, imu_.gyro, wheels_.t_us, wheels_.speed, first_wheels_us_, forward_acceleration_);
  alignment_.serialise(a);
  yaw_rate_.serialise(a);
  speed_.serialise(a);
  standstill_.serialise(a);
  levelling_.serialise(a);
  heading_.serialise(a);
  a(reset_counter_);
}

void WheelOdometry::save(StateWriter& writer) const {
  const auto put = [&](const auto&... members) { (writer.put(members), ...); };
  WheelOdometry copy = *this;  // serialise() reads as well
  copy.serialise(put);
}

void WheelOdometry::load(StateReader& reader) {
  const auto get = [&](auto&... members) { (reader.get(members), ...); };
  serialise(get);
}

}  // namespace roadfix
