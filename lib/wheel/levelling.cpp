#include "wheel/levelling.h"

#include <cmath>

#include "wheel/axle_motion.h"
#include "wheel/propagation.h"

namespace roadfix {

using namespace wheel;  // indices of the error state
namespace {

constexpr double kUncorrectedLevelling = 0.05;  ///< s of specific force per tilt correction without wheels

}  // namespace

void Levelling::add(const ImuSample& imu, double dt_s) {
  integral_.force += dt_s * imu.accel;
  integral_.gyro += dt_s * imu.gyro;
  integral_.time += dt_s;
}

void Levelling::reset() {
  integral_ = ImuIntegral{};
  begin_.t_us.reset();
}

void Levelling::add(WheelState& state, const LevellingPoint& now, const LevellingMotion& motion) {
  if (begin_.t_us && !motion.slipping) {
    const double dt = seconds_between(*begin_.t_us, *now.t_us);
    if (dt < std::sqrt(2.0) * motion.speed_sigma / (0.2 * config_.tuning.tilt_gate)) return;  // five sigma in the gate
    correct(state, now.gyro, (now.speed - begin_.speed) / dt, motion);
  }
  reset();
  begin_ = now;
}

void Levelling::add_uncorrected(WheelState& state, const Eigen::Vector3d& gyro, const LevellingMotion& motion) {
  if (integral_.time < kUncorrectedLevelling) return;
  correct(state, gyro, 0.0, motion);
  reset();
}

/// Derivative of the acceleration difference between axle and IMU by the lever arm.
Eigen::Matrix3d Levelling::lever_arm_jacobian(const WheelVector& x, const Eigen::Vector3d& gyro) const {
  if (!begin_.t_us) return Eigen::Matrix3d::Zero();
  const Eigen::Vector3d omega = integral_.gyro / integral_.time - x.segment<3>(kGyroBias);
  const Eigen::Vector3d omega_rate = (gyro - begin_.gyro) / integral_.time;
  Eigen::Matrix3d by_lever_arm;
  for (int i = 0; i < 3; ++i) by_lever_arm.col(i) = lever_arm_acceleration(Eigen::Vector3d::Unit(i), omega, omega_rate);
  return by_lever_arm;
}

void Levelling::correct(WheelState& state, const Eigen::Vector3d& gyro, double speed_rate,
                        const LevellingMotion& motion) const {
  if (integral_.time <= 0.0 || motion.slipping) return;
  const WheelTuning& t = config_.tuning;
  const WheelSensors& s = config_.sensors;
  GravityMeasurement gravity;
  // Specific force at the axle, with the calibrated lever arm.
  const Eigen::Matrix3d by_lever_arm = lever_arm_jacobian(state.x, gyro);
  gravity.force = integral_.force / integral_.time + by_lever_arm * s.p_imu_axle;
  gravity.gyro = integral_.gyro / integral_.time;
  gravity.speed_rate = motion.standing ? 0.0 : speed_rate;
  gravity.correct_acceleration = t.correct_acceleration;
  gravity.share = accelerometer_share(integral_.time, t.tilt_time_constant);
  const double off_g = std::abs(gravity_reaction(state.x, gravity).norm() - kStandardGravity);
  if (gravity.correct_acceleration && off_g >= t.tilt_gate) return;
  // The wheel noise telescopes in the sum of differences; (W.1.7) is what remains.
  const double white = process_noise(config_).accel / std::sqrt(integral_.time);
  const double wheels = motion.speed_sigma * std::sqrt(2.0 / (integral_.time * t.tilt_time_constant));
  update_tilt(state, gravity, std::hypot(white, wheels, (by_lever_arm * s.p_imu_axle_std.asDiagonal()).norm()));
}

}  // namespace roadfix
