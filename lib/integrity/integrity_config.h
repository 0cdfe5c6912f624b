/// What the protection levels assume, with units and sources. Equations: lib/integrity/MODEL.md.
#pragma once

#include <Eigen/Dense>

namespace roadfix {

/// The posterior of an error's scale, (P.2.n).
struct ErrorScaleConfig {
  double prior_dof = 6.0;    ///< independent squares that the claimed sigma counts for
  double memory = 30.0;      ///< s
  double correlation = 3.0;  ///< s, squares closer in time are not independent
};

/// Dead reckoning (POSE_WHEEL) beside the estimate, (P.4.n). Vectors: along, across, up.
struct WitnessConfig {
  Eigen::Vector3d ratio_std{0.01, 0.01, 0.02};      ///< of the way: scale and axes of the witness, before it is learnt
  double sideslip_std = 0.005;                      ///< rad per m/s2 of lateral acceleration, before it is learnt
  double yaw_rate_std = 0.002;                      ///< rad/s, bias of the witness, before it is learnt
  double yaw_rate_walk = 2e-5;                      ///< rad/s per sqrt(s)
  Eigen::Vector3d way_std{0.0006, 0.0004, 0.0015};  ///< of the way: what is left once it is learnt
  double floor = 0.01;                              ///< m, of one separation
  double ratio_walk = 5e-5;                         ///< per sqrt(s): tyres warm up, loads shift
  double short_lag = 3.0;                           ///< s
  double long_lag = 10.0;                           ///< s
  double false_alarm = 1e-6;                        ///< per axis and sample, of the test of a separation
  Eigen::Vector3d unwitnessed_std{0.3, 0.3, 0.5};   ///< m/s: drift that nothing but the receiver would show
};

struct IntegrityConfig {
  double frequent_risk = 1e-3;  ///< per sample: an error above the level in any axis
  double rare_risk = 1e-5;      ///< per sample; these levels are held against the alert limits
  /// m, along, across, up; a car on a freeway, Reid et al. (2019), table 5.
  Eigen::Vector3d alert_limit{1.40, 0.57, 1.30};
  ErrorScaleConfig tails;
  WitnessConfig witness;
  double correlated_share = 0.5;  ///< of the sigma of a fix: what does not average out, once it is verified
  /// m, of the antenna against its calibration: along it is measured by tape to an axle that is not seen, across to the
  /// centre line, up to the ground.
  Eigen::Vector3d lever_arm_std{0.1, 0.005, 0.03};
  double timing_std = 0.01;     ///< s, of the sensors' stamps against each other
  double fault_prior = 0.002;   ///< probability that a source has failed within `short_lag` and nothing shows it
  double look_back = 10.0;      ///< s: a fault that is detected now may have begun so long ago
  double recover = 120.0;       ///< s without contradiction until what contradicted is taken for well
  double verify = 20.0;         ///< s without contradiction until positions that came back are trusted
  double coasting_after = 3.5;  ///< s without an accepted position
  Eigen::Vector3d coasting_fault{0.03, 0.01, 0.01};  ///< of the way since: wheels or gyro fail unnoticed
};

template <class Visitor>
void visit(ErrorScaleConfig& c, Visitor& v) {
  v.number("prior_dof", c.prior_dof, 2.5, 1000.0);
  v.number("memory_s", c.memory, 1.0, 3600.0);
  v.number("correlation_s", c.correlation, 0.0, 3600.0);
}

template <class Visitor>
void visit(WitnessConfig& c, Visitor& v) {
  v.vector("ratio_std", c.ratio_std, 1e-5, 1.0);
  v.number("sideslip_std_rad_per_mps2", c.sideslip_std, 0.0, 0.1);
  v.number("yaw_rate_std_radps", c.yaw_rate_std, 0.0, 0.1);
  v.number("yaw_rate_walk_radps_per_rts", c.yaw_rate_walk, 0.0, 0.1);
  v.vector("way_std", c.way_std, 1e-6, 1.0);
  v.number("floor_m", c.floor, 1e-3, 10.0);
  v.number("ratio_walk_per_rts", c.ratio_walk, 0.0, 0.1);
  v.number("short_lag_s", c.short_lag, 0.5, 60.0);
  v.number("long_lag_s", c.long_lag, 0.5, 120.0);
  v.number("false_alarm", c.false_alarm, 1e-12, 0.1);
  v.vector("unwitnessed_std_mps", c.unwitnessed_std, 1e-3, 10.0);
}

template <class Visitor>
void visit(IntegrityConfig& c, Visitor& v) {
  v.number("frequent_risk", c.frequent_risk, 1e-9, 0.5);
  v.number("rare_risk", c.rare_risk, 1e-9, 0.5);
  v.check("rare_risk", c.rare_risk <= c.frequent_risk, "must not be above frequent_risk");
  v.vector("alert_limit_m", c.alert_limit, 1e-3, 1e4);
  v.group("tails", c.tails);
  v.group("witness", c.witness);
  v.number("correlated_share", c.correlated_share, 0.0, 1.0);
  v.vector("lever_arm_std_m", c.lever_arm_std, 0.0, 10.0);
  v.number("timing_std_s", c.timing_std, 0.0, 1.0);
  v.number("fault_prior", c.fault_prior, 1e-9, 1.0);
  v.number("look_back_s", c.look_back, 1.0, 300.0);
  v.number("recover_s", c.recover, 0.0, 3600.0);
  v.number("verify_s", c.verify, 0.0, 600.0);
  v.number("coasting_after_s", c.coasting_after, 0.1, 60.0);
  v.vector("coasting_fault", c.coasting_fault, 0.0, 1.0);
}

}  // namespace roadfix
