#include "navigation/propagation.h"

namespace roadfix::navigation {

namespace {

// Rate and acceleration are smoothed over this time: long enough against vibration, short against a car's manoeuvres.
constexpr double kMotionTime = 0.05;  // s

}  // namespace

void Propagation::move(Mean& x, const ImuSample& imu, double dt) {
  const inertial::InertialStep step = x.corrected(imu.gyro, imu.accel, dt);
  const Eigen::Vector3d v_before = x.nav.velocity;
  const Eigen::Vector3d earth_rate = x.nav.q_level_imu.conjugate() * earth_.rate();
  inertial::mechanise(x.nav, last_, step, earth_);
  x.t_us = imu.t_us;
  const double weight = last_.dt > 0.0 ? dt / (dt + kMotionTime) : 1.0;
  motion_.rate += weight * (step.rate - earth_rate - motion_.rate);
  motion_.acceleration += weight * ((1.0 / dt) * (x.nav.velocity - v_before) - motion_.acceleration);
  motion_.lag.advance(x.nav.velocity - v_before, dt);
  last_ = step;
}

void Propagation::add(Mean& x, const ImuSample& imu, double dt, const inertial::ImuNoise& noise) {
  sums_.add(x.nav, x.corrected(imu.gyro, imu.accel, dt), noise);
  move(x, imu, dt);
}

void Propagation::change_frame(const Eigen::Quaterniond& turn, const inertial::Earth& earth) {
  motion_.acceleration = turn * motion_.acceleration;
  motion_.lag = VelocityLag();
  earth_ = earth;
}

}  // namespace roadfix::navigation
