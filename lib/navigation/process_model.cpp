#include "navigation/process_model.h"

#include <algorithm>
#include <cmath>

#include "geodesy/gravity.h"
#include "inertial/strapdown.h"

namespace roadfix::navigation {

namespace {

constexpr double kHeadingTime = 30.0;  // s, in which a road turns by a radian
constexpr double kFadeWalk = 0.3;      // of the logarithm of a return's rate, 1/sqrt(s): in ten seconds a factor of 2.6

double square(double x) { return x * x; }

}  // namespace

void ProcessModel::decay(State& state, double dt) const {
  Mean& x = state.x;
  for (int i = 0; i < 3; ++i) x.gnss_bias(i) *= inertial::gauss_markov_decay(dt, gnss_bias_.position_time(i));
  x.gnss_velocity_bias *= inertial::gauss_markov_decay(dt, gnss_bias_.velocity_time);
  if (state.gnss_returns()) x.gnss_return *= std::exp(-dt * std::exp(x.return_rate));
}

ProcessModel::Diagonal ProcessModel::over(double T, const State& state, bool anchored) const {
  Diagonal d;
  d.decay.setOnes();
  d.noise.setZero();
  const VehicleFacts& v = facts_;
  const ProcessNoise& p = process_;
  // (N.2.4): the in-run part of biases and scales walks; what is beyond it is constant since turn-on.
  const double walk = 2.0 * T / v.correlation_s, accel_walk = 2.0 * T / v.accel_correlation_s.value_or(v.correlation_s);
  d.noise.segment<3>(kGyroBias) = walk * square(std::min(v.gyro_bias_std, p.gyro_drift_max)) * v.measured_rates();
  d.noise.segment<3>(kAccelBias).setConstant(accel_walk * square(std::min(v.accel_bias_std, p.accel_drift_max)));
  d.noise.segment<6>(kGyroScale).setConstant(walk * square(v.scale_std));
  if (!anchored && v.has_imu) {  // (N.2.10): where nobody knows the Earth's rate, biases hold it
    const double turned = 2.0 * T / kHeadingTime, coriolis = 2.0 * kEarthRate * state.x.nav.velocity.norm();
    d.noise.segment<3>(kGyroBias).array() += turned * square(kEarthRate);
    d.noise.segment<3>(kAccelBias).array() += turned * square(coriolis);
  }
  // What the calibration calls exact stays put.
  if (v.wheel_scale_std > 0.0) d.noise(kWheelScale) = square(p.wheel_scale_walk) * T;
  for (int i = 0; i < 2; ++i)
    if (v.mounting_std(1 + i) > 0.0) d.noise(kMounting + i) = square(p.mounting_walk) * T;
  for (int i = 0; i < 3; ++i)
    if (v.p_imu_antenna_std(i) > 0.0) d.noise(kAntenna + i) = square(p.antenna_walk) * T;
  const ClockPriors time(v);
  const double clock = square(p.clock_walk) * T;
  if (time.imu_offset > 0.0) d.noise(kImuOffset) = clock;
  if (time.position_latency > 0.0 && v.time_offset_std > 0.0) d.noise(kPositionLatency) = clock;
  if (time.wheel_latency > 0.0 && v.time_offset_std > 0.0 && time.imu_offset == 0.0) d.noise(kWheelLatency) = clock;
  const double velocity_decay = inertial::gauss_markov_decay(T, gnss_bias_.velocity_time);
  for (int i = 0; i < 3; ++i) {
    const double decay = inertial::gauss_markov_decay(T, gnss_bias_.position_time(i));
    d.decay(kGnssBias + i) = decay;
    d.noise(kGnssBias + i) =
        (1.0 - square(decay)) * square(gnss_bias_.position_std(i)) + square(gnss_bias_.position_walk(i)) * T;
  }
  d.decay.segment<3>(kGnssVelocityBias).setConstant(velocity_decay);
  d.noise.segment<3>(kGnssVelocityBias) = (1.0 - square(velocity_decay)) * gnss_bias_.velocity_std.cwiseAbs2();
  if (state.gnss_returns()) {
    d.decay.segment<3>(kGnssReturn).setConstant(std::exp(-T * std::exp(state.x.return_rate)));
    d.noise(kReturnRate) = square(kFadeWalk) * T;
  }
  return d;
}

}  // namespace roadfix::navigation
