#include "papers/adaptive_covariance.h"

#include <algorithm>
#include <cmath>

#include "samples/samples.h"

namespace roadfix {

void add_nis(ConsistencyCheck& c, const AdaptiveConfig& config, double nis, int dof) {
  c.ratio += (nis / dof - c.ratio) / config.nis_smoothing;
}

void set_gnss(DropoutRamp& ramp, const AdaptiveConfig& config, int64_t t_us, bool present) {
  if (present == ramp.gnss) return;
  ramp.level_at_change = ramp_level(ramp, config, t_us);
  ramp.changed_us = t_us;
  ramp.gnss = present;
}

double ramp_level(const DropoutRamp& ramp, const AdaptiveConfig& config, int64_t t_us) {
  if (!ramp.changed_us) return ramp.gnss ? 0.0 : 1.0;
  const double moved = config.ramp > 0.0 ? seconds_between(*ramp.changed_us, t_us) / config.ramp : 1.0;
  return std::clamp(ramp.level_at_change + (ramp.gnss ? -moved : moved), 0.0, 1.0);
}

double alpha_gnss(const AdaptiveConfig& config, const ConsistencyCheck& check) {
  return check.ratio <= config.consistent_nis ? config.alpha_gnss : 1.0;
}

double alpha_vio(const AdaptiveConfig& config, const ConsistencyCheck& check, double level) {
  const double alpha = config.alpha_vio + level * (config.alpha_vio_outage - config.alpha_vio);
  return check.ratio <= config.consistent_nis ? alpha : alpha * check.ratio;
}

Eigen::Matrix3d scaled_and_clipped(const Eigen::Matrix3d& R, double alpha, const AdaptiveConfig& config) {
  const Eigen::Vector3d sigma = (alpha * R.diagonal()).cwiseMax(1e-300).cwiseSqrt();
  Eigen::Vector3d factor;
  for (int i = 0; i < 3; ++i) {
    const double low = i < 2 ? config.min_position : config.min_yaw;
    const double high = i < 2 ? config.max_position : config.max_yaw;
    factor(i) = std::clamp(sigma(i), low, high) / sigma(i);
  }
  return alpha * factor.asDiagonal() * R * factor.asDiagonal();
}

}  // namespace roadfix
