#include "wheel/standstill.h"

#include <cmath>

#include "samples/samples.h"

namespace roadfix {
namespace {

void end_standstill(StandstillState& s) {
  s.still_since_us.reset();
  s.standing = false;
}

}  // namespace

void add_speed(StandstillState& s, const StandstillLimits& limits, int64_t t_us, double speed, bool trusted) {
  if (!trusted || std::abs(speed) > limits.speed) return end_standstill(s);
  if (!s.still_since_us) {
    s.still_since_us = t_us;
    s.reference_gyro = s.filtered_gyro;
  }
  s.standing = seconds_between(*s.still_since_us, t_us) >= limits.after;
}

void add_gyro(StandstillState& s, const StandstillLimits& limits, double dt_s, const Eigen::Vector3d& gyro) {
  s.filtered_gyro += dt_s / (kGyroSmoothing + dt_s) * (gyro - s.filtered_gyro);
  if (s.still_since_us && (s.filtered_gyro - s.reference_gyro).cwiseAbs().maxCoeff() > limits.rate) end_standstill(s);
}

}  // namespace roadfix
