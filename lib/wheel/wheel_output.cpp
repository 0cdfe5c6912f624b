#include "wheel/wheel_output.h"

#include "geometry/euler.h"
#include "geometry/so3.h"
#include "wheel/axle_motion.h"

namespace roadfix {

using namespace wheel;  // indices of the error state
namespace {

/// Jacobian from (roll, pitch, yaw) errors to the rotation error in vehicle axes: inverse of the Euler rate matrix
/// (W.10.1).
Eigen::Matrix3d rotation_by_angles(const Tilt& tilt) { return euler_rates_by_omega(tilt).inverse(); }

/// Covariance of what `by` makes of the uncertain lever arm.
Eigen::Matrix3d lever_arm_covariance(const WheelSensors& s, const Eigen::Matrix3d& by) {
  const Eigen::Matrix3d root = by * s.p_imu_axle_std.asDiagonal();
  return root * root.transpose();
}

/// Covariance of the axle's velocity: along the direction of travel and across it.
Eigen::Matrix3d velocity_covariance(const WheelState& state, const WheelTuning& tuning) {
  const WheelVector& x = state.x;
  const WheelCovariance& P = state.P;
  const double v = x(kSpeed), t = tuning.align_time;
  const double sideslip = tuning.sideslip_noise, heave = tuning.heave_noise;
  const Eigen::Matrix<double, 3, 2> by_direction = v * travel_direction_jacobian(x(kMountingYaw), x(kMountingPitch));
  const Eigen::Vector2d angles(P(kMountingYaw, kMountingYaw) + sideslip * sideslip / t,
                               P(kMountingPitch, kMountingPitch) + heave * heave / t);
  return P(kSpeed, kSpeed) * Eigen::Matrix3d::Identity() +
         by_direction * angles.asDiagonal() * by_direction.transpose();
}

}  // namespace

Odometry wheel_output(const WheelState& state, const WheelConfig& config, const Eigen::Vector3d& angular_rate) {
  const WheelVector& x = state.x;
  const WheelSensors& s = config.sensors;
  Odometry out;
  out.t_us = state.t_us;
  // The state is the displacement of the axle; the lever arm rotated by the yaw since the start gives that of the IMU
  // (W.10.2).
  const Eigen::Matrix3d tilted = quaternion({0.0, x(kPitch), x(kRoll)}).toRotationMatrix();
  const Eigen::Matrix3d turned = quaternion({x(kYaw), 0.0, 0.0}).toRotationMatrix();
  const Eigen::Matrix3d by_lever_arm = (Eigen::Matrix3d::Identity() - turned) * tilted;
  out.T_frame_vehicle.p = x.segment<3>(kPos) + by_lever_arm * s.p_imu_axle;
  out.T_frame_vehicle.q = quaternion({x(kYaw), x(kPitch), x(kRoll)});
  out.angular_rate = angular_rate;
  out.velocity = x(kSpeed) * travel_direction(x(kMountingYaw), x(kMountingPitch)) + s.p_imu_axle.cross(angular_rate);

  Eigen::Matrix<double, 6, kWheelStates> J = Eigen::Matrix<double, 6, kWheelStates>::Zero();
  J.block<3, 3>(0, kPos).setIdentity();
  J.block<3, 1>(0, kYaw) = -Eigen::Vector3d::UnitZ().cross(turned * tilted * s.p_imu_axle);
  const Eigen::Matrix3d by_angles = rotation_by_angles(state.tilt());
  J.block<3, 1>(3, kRoll) = by_angles.col(0);
  J.block<3, 1>(3, kPitch) = by_angles.col(1);
  J.block<3, 1>(3, kYaw) = by_angles.col(2);
  out.cov_pose = J * state.P * J.transpose();
  out.cov_pose.topLeftCorner<3, 3>() += lever_arm_covariance(s, by_lever_arm);
  out.cov_velocity = velocity_covariance(state, config.tuning);
  out.cov_velocity += lever_arm_covariance(s, skew(angular_rate));
  return out;
}

}  // namespace roadfix
