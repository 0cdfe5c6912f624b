#include "gnss_ins/ins_core.h"

#include <algorithm>
#include <cmath>

#include "geometry/so3.h"

namespace roadfix {

namespace {

// Rate and acceleration are smoothed over this time: long enough against vibration, short against a car's manoeuvres.
constexpr double kMotionTime = 0.05;  // s

}  // namespace

InsCore::InsCore(const GnssInsConfig& config, const Geodetic& anchor) : config_(config), earth_(anchor) {}

void InsCore::initialise(const NavState& x, const ErrorMatrix& P) {
  x_ = x;
  P_ = P;
  sums_ = TransitionSums();
  last_ = InertialStep();
  motion_ = BodyMotion();
}

void InsCore::predict(const ImuSample& imu, double dt, const ImuNoise& noise) {
  const InertialStep step = corrected(x_, imu, dt);
  const Eigen::Matrix3d R = x_.q_enu_imu.toRotationMatrix();
  const Eigen::Vector3d v_before = x_.velocity;
  const Eigen::Vector3d dv = mechanise(x_, R, last_, step, earth_);
  sums_.add(R + R * skew(0.5 * dt * step.rate), dv, step, noise.gyro, noise.accel);
  x_.t_us = imu.t_us;
  // exp(-x) to x^3 / 6, where x, samples over an hour, is 1e-5.
  const double share = dt / config_.vehicle.correlation_s;
  const double fade = share < 1e-3 ? 1.0 - share + 0.5 * share * share : std::exp(-share);
  x_.gyro_bias *= fade;
  x_.accel_bias *= fade;
  x_.gyro_scale *= fade;
  x_.accel_scale *= fade;
  const double weight = last_.dt > 0.0 ? dt / (dt + kMotionTime) : 1.0;
  motion_.rate += weight * (step.rate - R.transpose() * earth_.rate() - motion_.rate);
  motion_.acceleration += weight * ((x_.velocity - v_before) / dt - motion_.acceleration);
  last_ = step;
  if (!ahead_ && sums_.duration >= config_.propagation.covariance_interval - 1e-9) flush();
}

ErrorMatrix InsCore::covariance() const {
  ErrorMatrix P = P_;
  if (sums_.duration > 0.0) propagate_covariance(P, Transition(sums_, earth_.rate(), config_), sums_);
  return P;
}

double InsCore::longest_age() const {
  double longest = 0.0;
  for (const int latency : {kPositionLatency, kVelocityLatency}) {
    const double mean = (latency == kPositionLatency ? x_.position_latency : x_.velocity_latency) - x_.imu_offset;
    const double variance = P_(latency, latency) + P_(kImuOffset, kImuOffset) - 2.0 * P_(latency, kImuOffset);
    longest = std::max(longest, mean + 3.0 * std::sqrt(std::max(variance, 0.0)));
  }
  return longest;
}

void InsCore::flush() {
  propagate_covariance(P_, Transition(sums_, earth_.rate(), config_), sums_);
  sums_ = TransitionSums();
}

}  // namespace roadfix
