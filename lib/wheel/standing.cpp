#include "wheel/standing.h"

#include <cmath>

#include "samples/samples.h"

namespace roadfix {
namespace {

void move(StandingState& s) {
  s.quiet_since_us.reset();
  s.standing = false;
}

}  // namespace

void add_speed(StandingState& s, const StandingLimits& limits, int64_t t_us, double speed, bool trusted) {
  if (!trusted || std::abs(speed) > limits.speed) return move(s);
  if (!s.quiet_since_us) {
    s.quiet_since_us = t_us;
    s.quiet_gyro = s.slow_gyro;
  }
  s.standing = seconds_between(*s.quiet_since_us, t_us) >= limits.after;
}

void add_gyro(StandingState& s, const StandingLimits& limits, double dt_s, const Eigen::Vector3d& gyro) {
  s.slow_gyro += dt_s / (kGyroSmoothing + dt_s) * (gyro - s.slow_gyro);
  if (s.quiet_since_us && (s.slow_gyro - s.quiet_gyro).cwiseAbs().maxCoeff() > limits.rate) move(s);
}

}  // namespace roadfix
