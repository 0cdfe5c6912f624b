#include "gnss_ins/ins_core.h"

#include <algorithm>
#include <cmath>

namespace roadfix {

namespace {

// Rate and acceleration are smoothed over this time: long enough against vibration, short against a car's manoeuvres.
constexpr double kMotionTime = 0.05;  // s

}  // namespace

InsCore::InsCore(const GnssInsConfig& config, const Geodetic& anchor) : config_(config), earth_(anchor) {}

void InsCore::initialise(const NavState& x, const ErrorMatrix& P) {
  x_ = x;
  P_ = P;
  fix_error_ = FixError();
  if (scale_steps_.follows()) scale_steps_.begin();
  sums_ = TransitionSums();
  last_ = InertialStep();
  motion_ = BodyMotion();
}

void InsCore::predict(const ImuSample& imu, double dt, const ImuNoise& noise) {
  const InertialStep step = corrected(x_, imu, dt);
  const PaddedRotation R = padded_rotation(x_.q_enu_imu);
  const Eigen::Vector3d v_before = x_.velocity;
  const Eigen::Vector3d dv = mechanise(x_, R, last_, step, earth_);
  sums_.add(R, dv, step, noise.gyro, noise.accel);
  x_.t_us = imu.t_us;
  const double fade = fading(dt, config_.vehicle.correlation_s);
  x_.gyro_bias *= fade;
  x_.accel_bias *= fade;
  x_.gyro_scale *= fade;
  x_.accel_scale *= fade;
  const double weight = last_.dt > 0.0 ? dt / (dt + kMotionTime) : 1.0;
  motion_.rate += weight * (step.rate - R.topRows<3>().transpose().lazyProduct(earth_.rate()) - motion_.rate);
  motion_.acceleration += weight * ((1.0 / dt) * (x_.velocity - v_before) - motion_.acceleration);
  last_ = step;
  if (!ahead_ && sums_.duration >= config_.propagation.covariance_interval - 1e-9) flush();
}

ErrorMatrix InsCore::covariance() const {
  if (sums_.duration <= 0.0) return P_;
  ErrorMatrix P;
  propagate_covariance(P_, Transition(sums_, earth_.rate(), config_), sums_, P);
  return P;
}

OutputErrorMatrix InsCore::output_covariance() const {
  return propagate_output_covariance(P_, Transition(sums_, earth_.rate(), config_), sums_);
}

double InsCore::longest_age(bool wheels) const {
  double longest = 0.0;
  const ErrorVector x = local(NavState(), x_);
  for (const int latency : {kPositionLatency, kVelocityLatency, kWheelLatency}) {
    if (latency == kWheelLatency && !wheels) continue;
    const double mean = x(latency) - x(kImuOffset);
    const double variance = P_(latency, latency) + P_(kImuOffset, kImuOffset) - 2.0 * P_(latency, kImuOffset);
    longest = std::max(longest, mean + 3.0 * std::sqrt(std::max(variance, 0.0)));
  }
  return longest;
}

bool InsCore::mend_scale(double sigmas) {
  if (!scale_steps_.most_likely(sigmas)) {
    scale_steps_.advance(x_.t_us);
    return false;
  }
  flush();
  const ScaleSteps::Since step = *scale_steps_.most_likely(sigmas);
  x_ = retract(x_, step.size() * step.per_unit);
  P_ += (1.0 / step.information) * (step.per_unit * step.per_unit.transpose()).eval();
  scale_steps_.begin();
  return true;
}

void InsCore::flush() {
  if (sums_.duration <= 0.0) return;
  const Transition phi(sums_, earth_.rate(), config_);
  propagate_covariance(P_, phi, sums_, P_);
  if (fix_error_.active()) fix_error_.move(phi, sums_.duration);
  scale_steps_.move(phi);
  sums_ = TransitionSums();
}

}  // namespace roadfix
