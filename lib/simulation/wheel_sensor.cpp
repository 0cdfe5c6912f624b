#include <cmath>

#include "simulation/sensors.h"

namespace roadfix {
namespace {

/// Ground speeds of the four wheels along their own rolling directions (front left, front right, rear left, rear
/// right): the rear axle's centre does not slip sideways, the front wheels are steered to where they go.
std::array<double, 4> rolling_speeds(double speed, double yaw_rate, const WheelsConfig& c) {
  const double half = 0.5 * c.track_width_m * yaw_rate;
  const double across = c.wheelbase_m * yaw_rate;
  const auto front = [&](double along) { return std::copysign(std::hypot(along, across), along); };
  return {front(speed - half), front(speed + half), speed - half, speed + half};
}

/// Signed speed over the ground of the vehicle's origin.
double ground_speed(const Kinematics& k) {
  const Eigen::Vector3d forward = k.T_enu_vehicle.q * Eigen::Vector3d::UnitX();
  return std::copysign(k.velocity_enu.norm(), forward.dot(k.velocity_enu));
}

}  // namespace

void simulate_wheels(SimulatedDrive& drive) {
  const WheelsConfig& c = drive.config.wheels;
  if (c.layout == WheelLayout::kNone) return;
  RandomStream noise = stream_of(drive, NoiseStream::kWheelNoise);
  RandomStream scale = stream_of(drive, NoiseStream::kWheelScale);
  RandomStream yaw_rate = stream_of(drive, NoiseStream::kYawRate);
  const double common = c.speed_scale_std * scale.normal();
  const bool four = c.layout == WheelLayout::kFourSpeeds;
  for (double& s : drive.errors.wheel_scale) s = common + (four ? c.wheel_scale_std * scale.normal() : 0.0);
  drive.errors.yaw_rate_bias = c.yaw_rate_bias_std_radps * yaw_rate.normal();
  const auto offset_us = static_cast<std::int64_t>(std::llround(c.clock_offset_s * 1e6));
  for (const std::int64_t t_us : sample_times(c.rate_hz, 0.0, drive.config.duration_s)) {
    const Kinematics k = drive.motion->at(seconds_between(0, t_us));
    const double speed = ground_speed(k);
    WheelSample sample;
    sample.t_us = drive.config.start_utime + t_us + offset_us;
    sample.num_speeds = four ? 4 : 1;
    if (four)
      sample.speeds = rolling_speeds(speed, k.angular_rate.z(), c);
    else
      sample.speeds[0] = speed;
    for (std::size_t i = 0; i < static_cast<std::size_t>(sample.num_speeds); ++i) {
      double& s = sample.speeds[i];
      s = s * (1.0 + drive.errors.wheel_scale[i]) + c.speed_noise_mps * noise.normal();
      if (c.resolution_mps > 0.0) s = c.resolution_mps * std::round(s / c.resolution_mps);
      if (c.signs != WheelSigns::kSigned) s = std::abs(s);
    }
    if (c.signs == WheelSigns::kUnsigned) sample.direction = WheelDirection::kUnknown;
    if (c.signs == WheelSigns::kGear)
      sample.direction = speed < 0.0 ? WheelDirection::kReverse : WheelDirection::kForward;
    if (c.has_yaw_rate) {
      sample.yaw_rate = k.angular_rate.z() + drive.errors.yaw_rate_bias + c.yaw_rate_noise_radps * yaw_rate.normal();
    }
    drive.wheels.push_back(sample);
  }
}

}  // namespace roadfix
