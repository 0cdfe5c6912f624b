#include "wheel/yaw_rate_source.h"

namespace roadfix {

using namespace wheel;  // indices of the error state

void YawRateSource::add(const WheelMotion& motion) {
  switch (config_.tuning.yaw_source) {
    case YawSource::kVehicleSensor:
      wheel_rate_ = motion.sensor_yaw_rate;
      break;
    case YawSource::kWheelSides:
      wheel_rate_ = motion.sides_yaw_rate;
      break;
    case YawSource::kAutomatic:
      wheel_rate_ = motion.sensor_yaw_rate ? motion.sensor_yaw_rate : motion.sides_yaw_rate;
      break;
    case YawSource::kGyro:
      wheel_rate_.reset();
      break;
  }
}

void YawRateSource::select_with_imu(WheelState& state) {
  const YawSource source = config_.tuning.yaw_source;
  const bool gyro = source == YawSource::kAutomatic || source == YawSource::kGyro;
  if (gyro) known_ = true;
  select(state, gyro);
}

void YawRateSource::select_without_imu(WheelState& state) {
  known_ = wheel_rate_.has_value();
  if (known_) select(state, false);
}

void YawRateSource::select(WheelState& state, bool gyro) {
  if (gyro == is_gyro_) return;
  is_gyro_ = gyro;
  const WheelSensors& s = config_.sensors;
  state.x(kGyroBias + 2) = 0.0;
  decouple(state.P, kGyroBias + 2, gyro ? s.gyro_bias_std : s.wheel_yaw_bias_std);
}

Eigen::Vector3d YawRateSource::rate(const Eigen::Vector3d& gyro) const {
  return is_gyro_ ? gyro : Eigen::Vector3d(gyro.x(), gyro.y(), wheel_rate_.value_or(0.0));
}

}  // namespace roadfix
