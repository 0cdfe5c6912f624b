// Outputs of the wheel odometry: pose, report, snapshot (MODEL.md, section 10).
#include <cmath>

#include "geometry/euler.h"
#include "geometry/so3.h"
#include "wheel/axle_motion.h"
#include "wheel/wheel_odometry.h"

namespace roadfix {

using namespace wheel;  // indices of the error state
namespace {

constexpr double kLostSpeedSigma = 3.0;  ///< m/s: the speed is lost
constexpr double kLostYawSigma = 0.8;    ///< rad: the yaw is lost
constexpr double kTurnOnChange = 0.3;    ///< of the calibrated bias sigma: change between two starts (assumed)

/// Jacobian from (roll, pitch, yaw) errors to the rotation error in vehicle axes: inverse of the Euler rate matrix
/// (W.10.1).
Eigen::Matrix3d rotation_by_angles(const Tilt& tilt) { return euler_rates_by_omega(tilt).inverse(); }

}  // namespace

Odometry WheelOdometry::odometry() const {
  Odometry out;
  out.t_us = t_us_;
  if (!started_) return out;
  const WheelVector& x = state_.x;
  const WheelCovariance& P = state_.P;
  // The state is the displacement of the axle; the lever arm rotated by the yaw since the start gives that of the IMU
  // (W.10.2).
  const WheelSensors& s = config_.sensors;
  const Eigen::Matrix3d tilted = quaternion({0.0, x(kPitch), x(kRoll)}).toRotationMatrix();
  const Eigen::Matrix3d turned = quaternion({x(kYaw), 0.0, 0.0}).toRotationMatrix();
  const Eigen::Matrix3d by_lever_arm = (Eigen::Matrix3d::Identity() - turned) * tilted;
  out.T_frame_vehicle.p = x.segment<3>(kPos) + by_lever_arm * s.p_imu_axle;
  out.T_frame_vehicle.q = quaternion({x(kYaw), x(kPitch), x(kRoll)});
  if (!standstill_.standing) {
    out.angular_rate = gyro_;
    if (!gyro_yaw_) out.angular_rate.z() = wheel_yaw_rate_.value_or(0.0);
    out.angular_rate -= x.segment<3>(kGyroBias);
  }
  const Eigen::Vector3d e = travel_direction(x(kMountingYaw), x(kMountingPitch));
  out.velocity = x(kSpeed) * e + s.p_imu_axle.cross(out.angular_rate);

  Eigen::Matrix<double, 6, kWheelStates> J = Eigen::Matrix<double, 6, kWheelStates>::Zero();
  J.block<3, 3>(0, kPos).setIdentity();
  J.block<3, 1>(0, kYaw) = -Eigen::Vector3d::UnitZ().cross(turned * tilted * s.p_imu_axle);
  const Eigen::Matrix3d by_angles = rotation_by_angles(state_.tilt());
  J.block<3, 1>(3, kRoll) = by_angles.col(0);
  J.block<3, 1>(3, kPitch) = by_angles.col(1);
  J.block<3, 1>(3, kYaw) = by_angles.col(2);
  out.cov_pose = J * P * J.transpose();
  const auto lever_arm_covariance = [&](const Eigen::Matrix3d& by) -> Eigen::Matrix3d {
    const Eigen::Matrix3d root = by * s.p_imu_axle_std.asDiagonal();
    return root * root.transpose();
  };
  out.cov_pose.topLeftCorner<3, 3>() += lever_arm_covariance(by_lever_arm);

  const double v = x(kSpeed), t = config_.tuning.align_time;
  const double sideslip = config_.tuning.sideslip_noise, heave = config_.tuning.heave_noise;
  const Eigen::Matrix<double, 3, 2> by_direction = v * travel_direction_jacobian(x(kMountingYaw), x(kMountingPitch));
  const Eigen::Vector2d angles(P(kMountingYaw, kMountingYaw) + sideslip * sideslip / t,
                               P(kMountingPitch, kMountingPitch) + heave * heave / t);
  out.cov_velocity =
      P(kSpeed, kSpeed) * Eigen::Matrix3d::Identity() + by_direction * angles.asDiagonal() * by_direction.transpose();
  out.cov_velocity += lever_arm_covariance(skew(out.angular_rate));
  out.validity = report().validity;
  return out;
}

WheelReport WheelOdometry::report() const {
  WheelReport r;
  r.reset_counter = reset_counter_;
  r.standing = standstill_.standing;
  r.slipping = slip_since_us_.has_value();
  if (!started_) {
    r.phase = wheels_us_ && imu_us_ ? WheelPhase::kAligning : WheelPhase::kWaiting;
    r.reason = !wheels_us_ ? "waits for wheels" : (!imu_us_ ? "waits for imu" : "levels by the accelerometer");
    return r;
  }
  const auto weak = [&](const char* reason) {
    r.phase = WheelPhase::kWeak;
    r.validity = Validity::kCoasting;
    r.reason = reason;
  };
  const bool imu_silent = !imu_us_ || seconds_between(*imu_us_, t_us_) > config_.tuning.imu_timeout;
  r.phase = WheelPhase::kRunning;
  r.validity = Validity::kValid;
  if (imu_silent && yaw_known_) weak("no imu: level road assumed, yaw rate from the wheels");
  if (direction_.assumed) weak("direction unknown, forward assumed");
  if (direction_.undecided_since_us) weak("direction unknown");
  if (r.slipping) weak("wheels slip: speed from the accelerometer");
  if (seconds_between(*wheels_us_, t_us_) > config_.tuning.wheel_timeout)
    weak("no wheels: speed from the accelerometer");
  if (!yaw_known_) weak("no yaw rate: neither imu nor wheels tell it");
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

void WheelOdometry::restore(const WheelMemory& memory) {
  const bool sane =
      memory.gyro_bias.allFinite() && memory.gyro_bias_sigma.allFinite() && memory.gyro_bias_sigma.minCoeff() >= 0.0;
  if (started_ || !sane) return;
  const double spread = config_.sensors.gyro_bias_std, change = kTurnOnChange * spread;
  restored_ = true;
  prior_.gyro_bias = memory.gyro_bias;
  for (int i = 0; i < 3; ++i)
    prior_.gyro_bias_sigma(i) = std::min(spread, std::hypot(memory.gyro_bias_sigma(i), change));
}

template <class Self, class Visitor>
void WheelOdometry::visit_members(Self& self, const Visitor& visit) {
  visit(self.state_.x, self.state_.P, self.started_, self.t_us_, self.imu_us_, self.wheels_us_, self.first_us_);
  visit(self.raw_speed_, self.smallest_change_, self.num_changes_);
  visit(self.last_speed_, self.forward_acceleration_, self.wheel_yaw_rate_, self.gyro_);
  visit(self.gyro_yaw_, self.yaw_known_, self.slip_since_us_);
  visit(self.standstill_.still_since_us, self.standstill_.filtered_gyro, self.standstill_.reference_gyro,
        self.standstill_.standing, self.turning_at_standstill_, self.bias_tested_);
  visit(self.direction_.sign, self.direction_.assumed, self.direction_.undecided_since_us);
  visit(self.levelling_force_, self.levelling_gyro_, self.levelling_time_, self.levelling_begin_us_,
        self.levelling_begin_speed_, self.levelling_begin_gyro_);
  visit(self.align_force_, self.align_time_, self.block_gyro_, self.block_time_);
  visit(self.mag_us_, self.mag_strength_, self.mag_dip_, self.reset_counter_);
  visit(self.restored_, self.prior_.gyro_bias, self.prior_.gyro_bias_sigma);
}

void WheelOdometry::save(StateWriter& writer) const {
  visit_members(*this, [&](const auto&... members) { (writer.put(members), ...); });
}

void WheelOdometry::load(StateReader& reader) {
  visit_members(*this, [&](auto&... members) { (reader.get(members), ...); });
}

}  // namespace roadfix
