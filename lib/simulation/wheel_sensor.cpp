#include <cmath>

#include "simulation/link.h"
#include "simulation/sensors.h"

namespace roadfix {
namespace {

/// Ground speeds of the four wheels along their own rolling directions (front left, front right, rear left, rear
/// right): the rear ones along the car, the front ones steered to where they go.
std::array<double, 4> rolling_speeds(const Eigen::Vector3d& velocity, double yaw_rate, const WheelsConfig& c) {
  const double speed = velocity.x();
  const double half = 0.5 * c.track_width_m * yaw_rate;
  const double across = velocity.y() + c.wheelbase_m * yaw_rate;
  const auto front = [&](double along) { return std::copysign(std::hypot(along, across), along); };
  return {front(speed - half), front(speed + half), speed - half, speed + half};
}

/// True speeds with what faults do to the wheels themselves.
void disturb(FaultSet& faults, double t_s, WheelSample& sample, double& noise_factor, bool& is_unsigned) {
  faults.for_each(t_s, [&](ActiveFault& f) {
    if (f->kind == FaultKind::kNoise) noise_factor *= f->get("factor");
    if (f->kind == FaultKind::kUnsigned) is_unsigned = true;
    for (int i = 0; i < sample.num_speeds; ++i) {
      double& speed = sample.speeds[static_cast<std::size_t>(i)];
      const bool driven = sample.num_speeds == 1 || i >= 2;
      if (f->kind == FaultKind::kSlip && driven) speed *= 1.0 + f->get("ratio");
      if (f->kind == FaultKind::kScale) speed *= 1.0 + f->get("ratio");
      if (f->kind == FaultKind::kLock) speed = 0.0;
    }
  });
}

struct WheelErrorSource {
  RandomStream noise;
  RandomStream yaw_rate;
};

WheelErrorSource draw_errors(SimulatedDrive& drive) {
  const WheelsConfig& c = drive.config.wheels;
  WheelErrorSource source{stream_of(drive, NoiseStream::kWheelNoise), stream_of(drive, NoiseStream::kYawRate)};
  RandomStream scale = stream_of(drive, NoiseStream::kWheelScale);
  const double common = c.speed_scale_std * scale.normal();
  const double own = c.layout == WheelLayout::kFourSpeeds ? c.wheel_scale_std : 0.0;
  for (double& s : drive.errors.wheel_scale) s = common + own * scale.normal();
  drive.errors.yaw_rate_bias = c.yaw_rate_bias_std_radps * source.yaw_rate.normal();
  return source;
}

WheelSample measure(const SimulatedDrive& drive, std::int64_t t_us, FaultSet& faults, WheelErrorSource& source) {
  const WheelsConfig& c = drive.config.wheels;
  const Kinematics k = drive.motion->at(seconds_between(0, t_us));
  const Eigen::Vector3d velocity = k.T_enu_vehicle.q.conjugate() * k.velocity_enu;  // of the rear axle, vehicle axes
  const double speed = velocity.x();
  WheelSample sample;
  sample.t_us = drive.config.start_utime + t_us;
  sample.num_speeds = c.layout == WheelLayout::kFourSpeeds ? 4 : 1;
  sample.speeds[0] = speed;
  if (sample.num_speeds == 4) sample.speeds = rolling_speeds(velocity, k.angular_rate.z(), c);
  double noise_factor = 1.0;
  bool is_unsigned = c.signs == WheelSigns::kUnsigned;
  disturb(faults, seconds_between(0, t_us), sample, noise_factor, is_unsigned);
  for (std::size_t i = 0; i < static_cast<std::size_t>(sample.num_speeds); ++i) {
    double& s = sample.speeds[i];
    s = s * (1.0 + drive.errors.wheel_scale[i]) + noise_factor * c.speed_noise_mps * source.noise.normal();
    if (c.resolution_mps > 0.0) s = c.resolution_mps * std::round(s / c.resolution_mps);
    if (is_unsigned || c.signs == WheelSigns::kGear) s = std::abs(s);
  }
  if (c.signs == WheelSigns::kGear)
    sample.direction = speed < 0.0 ? WheelDirection::kReverse : WheelDirection::kForward;
  if (is_unsigned) sample.direction = WheelDirection::kUnknown;
  if (c.has_yaw_rate) {
    sample.yaw_rate =
        k.angular_rate.z() + drive.errors.yaw_rate_bias + c.yaw_rate_noise_radps * source.yaw_rate.normal();
  }
  return sample;
}

}  // namespace

void simulate_wheels(SimulatedDrive& drive) {
  const WheelsConfig& c = drive.config.wheels;
  if (c.layout == WheelLayout::kNone) return;
  WheelErrorSource source = draw_errors(drive);
  FaultSet faults(drive, Sensor::kWheels);
  for (const std::int64_t t_us : sample_times(c.rate_hz, 0.0, drive.config.duration_s)) {
    drive.wheels.push_back(measure(drive, t_us, faults, source));
  }
  deliver<WheelSample, int>(drive, Sensor::kWheels, c.link, drive.wheels, nullptr, drive.deliveries.wheels);
}

}  // namespace roadfix
