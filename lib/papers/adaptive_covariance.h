/// Lee et al. (2025), section 3.2.2: what a channel's covariance is multiplied with and clipped to, and how that changes when
/// GNSS goes and comes back. Kept as printed; the default scheme (relative motion and gained information) needs none of
/// it.
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <optional>

namespace roadfix {

struct AdaptiveConfig {
  double alpha_gnss = 0.5;        ///< on a GNSS/INS covariance that passes the consistency check
  double alpha_vio = 4.0;         ///< on a VIO covariance while GNSS is there
  double alpha_vio_outage = 1.0;  ///< reached by a linear ramp after GNSS is lost
  double ramp = 5.0;              ///< s, of that ramp and of the way back
  double consistent_nis = 2.0;    ///< smoothed NIS per degree of freedom up to which a covariance is consistent
  double nis_smoothing = 20.0;    ///< samples
  double min_position = 0.01;     ///< m, clip of the standard deviations
  double max_position = 50.0;     ///< m
  double min_yaw = 0.0005;        ///< rad
  double max_yaw = 1.0;           ///< rad
  double gate = 16.3;             ///< squared Mahalanobis distance, 99.9 % of 3 degrees of freedom
};

template <class Visitor>
void visit(AdaptiveConfig& c, Visitor& v) {
  v.number("alpha_gnss", c.alpha_gnss, 0.01, 1.0);
  v.number("alpha_vio", c.alpha_vio, 1.0, 100.0);
  v.number("alpha_vio_outage", c.alpha_vio_outage, 0.01, 100.0);
  v.number("ramp_s", c.ramp, 0.0, 600.0);
  v.number("consistent_nis", c.consistent_nis, 0.1, 100.0);
  v.number("nis_smoothing", c.nis_smoothing, 1.0, 1e6);
  v.number("min_position_m", c.min_position, 0.0, 1000.0);
  v.number("max_position_m", c.max_position, 0.001, 1e6);
  v.number("min_yaw_rad", c.min_yaw, 0.0, 3.0);
  v.number("max_yaw_rad", c.max_yaw, 1e-5, 10.0);
  v.number("gate", c.gate, 0.1, 1e6);
}

/// Smoothed NIS per degree of freedom of one channel.
struct ConsistencyCheck {
  double ratio = 1.0;
};
void add_nis(ConsistencyCheck& c, const AdaptiveConfig& config, double nis, int dof);

/// Linear ramp of alpha_vio by the time since GNSS was lost, and back by the time since it returned. The way back
/// starts where the way there had come to.
struct DropoutRamp {
  bool gnss = true;
  std::optional<int64_t> changed_us;
  double level_at_change = 0.0;  ///< 0: alpha_vio, 1: alpha_vio_outage
};
void set_gnss(DropoutRamp& ramp, const AdaptiveConfig& config, int64_t t_us, bool present);
double ramp_level(const DropoutRamp& ramp, const AdaptiveConfig& config, int64_t t_us);

double alpha_gnss(const AdaptiveConfig& config, const ConsistencyCheck& check);
double alpha_vio(const AdaptiveConfig& config, const ConsistencyCheck& check, double ramp_level);

/// alpha R with standard deviations clipped to [R_min, R_max]; correlations are kept.
Eigen::Matrix3d scaled_and_clipped(const Eigen::Matrix3d& R, double alpha, const AdaptiveConfig& config);

}  // namespace roadfix
