#include "gnss_ins/nav_state.h"

#include "geometry/so3.h"

namespace roadfix {

Eigen::Matrix3d NavState::R_imu_vehicle() const { return exp_so3(Eigen::Vector3d(0.0, mounting.x(), mounting.y())); }

NavState retract(const NavState& x, const ErrorVector& dx) {
  NavState y = x;
  y.position += dx.segment<3>(kPos);
  y.velocity += dx.segment<3>(kVel);
  y.q_enu_imu = (exp_q(dx.segment<3>(kAtt)) * x.q_enu_imu).normalized();
  y.gyro_bias += dx.segment<3>(kGyroBias);
  y.accel_bias += dx.segment<3>(kAccelBias);
  y.gyro_scale += dx.segment<3>(kGyroScale);
  y.accel_scale += dx.segment<3>(kAccelScale);
  y.wheel_scale += dx(kWheelScale);
  y.mounting += dx.segment<2>(kMounting);
  y.position_latency += dx(kPositionLatency);
  y.velocity_latency += dx(kVelocityLatency);
  y.imu_offset += dx(kImuOffset);
  y.wheel_latency += dx(kWheelLatency);
  y.p_imu_axle += dx.segment<3>(kAxle);
  y.p_imu_antenna += dx.segment<3>(kAntenna);
  return y;
}

ErrorVector local(const NavState& x, const NavState& y) {
  ErrorVector dx;
  dx.segment<3>(kPos) = y.position - x.position;
  dx.segment<3>(kVel) = y.velocity - x.velocity;
  dx.segment<3>(kAtt) = log_q(y.q_enu_imu * x.q_enu_imu.conjugate());
  dx.segment<3>(kGyroBias) = y.gyro_bias - x.gyro_bias;
  dx.segment<3>(kAccelBias) = y.accel_bias - x.accel_bias;
  dx.segment<3>(kGyroScale) = y.gyro_scale - x.gyro_scale;
  dx.segment<3>(kAccelScale) = y.accel_scale - x.accel_scale;
  dx(kWheelScale) = y.wheel_scale - x.wheel_scale;
  dx.segment<2>(kMounting) = y.mounting - x.mounting;
  dx(kPositionLatency) = y.position_latency - x.position_latency;
  dx(kVelocityLatency) = y.velocity_latency - x.velocity_latency;
  dx(kImuOffset) = y.imu_offset - x.imu_offset;
  dx(kWheelLatency) = y.wheel_latency - x.wheel_latency;
  dx.segment<3>(kAxle) = y.p_imu_axle - x.p_imu_axle;
  dx.segment<3>(kAntenna) = y.p_imu_antenna - x.p_imu_antenna;
  return dx;
}

}  // namespace roadfix
