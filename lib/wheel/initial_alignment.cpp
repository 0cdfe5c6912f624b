#include "wheel/initial_alignment.h"

#include <algorithm>
#include <cmath>

#include "inertial/imu_noise.h"
#include "wheel/axle_motion.h"
#include "wheel/propagation.h"

namespace roadfix {

using namespace wheel;  // indices of the error state

void InitialAlignment::restore(const WheelMemory& memory) {
  const bool sane =
      memory.gyro_bias.allFinite() && memory.gyro_bias_sigma.allFinite() && memory.gyro_bias_sigma.minCoeff() >= 0.0;
  if (!sane) return;
  const double spread = config_.sensors.gyro_bias_std, change = inertial::kTurnOnChange * spread;
  restored_ = true;
  prior_.gyro_bias = memory.gyro_bias;
  for (int i = 0; i < 3; ++i)
    prior_.gyro_bias_sigma(i) = std::min(spread, std::hypot(memory.gyro_bias_sigma(i), change));
}

void InitialAlignment::add(const ImuIntegral& imu, double speed, double speed_rate) {
  if (imu.time <= 0.0 || imu.time >= config_.tuning.wheel_timeout) return;
  force_ += imu.force;
  if (config_.tuning.correct_acceleration)
    force_ -=
        imu.time * axle_acceleration(speed, speed_rate, imu.gyro / imu.time,
                                     travel_direction(config_.sensors.mounting_yaw, config_.sensors.mounting_pitch));
  time_ += imu.time;
}

bool InitialAlignment::complete() const { return time_ > 0.0 && time_ >= config_.tuning.align_time; }

WheelState InitialAlignment::levelled(int64_t t_us, const InitialSpeed& speed) const {
  const double sigma = process_noise(config_).accel / std::sqrt(time_) / kStandardGravity;
  return state(t_us, tilt_of_gravity(force_), sigma, speed);
}

WheelState InitialAlignment::level(int64_t t_us, const InitialSpeed& speed) const {
  return state(t_us, {0.0, 0.0}, kRoadTilt, speed);
}

WheelState InitialAlignment::state(int64_t t_us, const Tilt& tilt, double tilt_sigma, const InitialSpeed& speed) const {
  const WheelSensors& s = config_.sensors;
  WheelState first;
  first.t_us = t_us;
  WheelVector& x = first.x;
  WheelCovariance& P = first.P;
  x(kRoll) = tilt.roll;
  x(kPitch) = tilt.pitch;
  for (int i = 0; i < 3; ++i) {
    decouple(P, kGyroBias + i, restored_ ? prior_.gyro_bias_sigma(i) : s.gyro_bias_std);
    x(kGyroBias + i) = prior_.gyro_bias(i);
  }
  for (int i = 0; i < 2; ++i) decouple(P, kAccelBias + i, s.accel_bias_std);
  x(kMountingYaw) = s.mounting_yaw;
  x(kMountingPitch) = s.mounting_pitch;
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
  const double v = speed.value, scale_variance = s.wheel_scale_std * s.wheel_scale_std;
  x(kSpeed) = v;
  P(kSpeed, kSpeed) = s.wheel_noise * s.wheel_noise + v * v * (speed.sign_unknown ? 4.0 : scale_variance);
  P(kSpeed, kWheelScale) = P(kWheelScale, kSpeed) = v * scale_variance;
  return first;
}

}  // namespace roadfix
