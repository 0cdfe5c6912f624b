/// What the visual-inertial filter must be told. MsckfVehicle: facts of the vehicle (calibration). MsckfTuning: one set
/// of defaults for every vehicle. Numbers without another source: chosen on simulated drives.
#pragma once

#include <Eigen/Dense>
#include <optional>

#include "geometry/se3.h"

namespace roadfix {

/// s, standard deviation of a camera's time offset of which the calibration is silent: exposure, transport and two
/// clocks. As much as the filter finds without searching for it, (M.47).
inline constexpr double kSilentClockStd = 0.03;

/// Facts of the sensors and of how they sit; a wide sigma says that something is to be estimated, a zero that it is
/// known.
struct MsckfVehicle {
  double gyro_noise = 1.0e-4;       ///< rad/s/sqrt(Hz)
  double accel_noise = 1.0e-3;      ///< m/s2/sqrt(Hz)
  double gyro_bias_std = 1.0e-3;    ///< rad/s
  double accel_bias_std = 0.05;     ///< m/s2
  double scale_std = 1.0e-3;        ///< of gyro and accelerometer
  double correlation_s = 3600.0;    ///< of the biases
  double gravity = 9.807;           ///< m/s2; what is wrong with it shows as an accelerometer bias
  SE3 T_imu_camera;                 ///< of the left camera, as calibrated
  double camera_std = 0.0;          ///< m
  double camera_turn_std = 0.0;     ///< rad
  std::optional<SE3> T_left_right;  ///< stereo: right camera's coordinates to the left one's
  double time_offset = 0.0;         ///< s: imu time = stamp + this
  double time_offset_std = 0.0;     ///< s, of the camera's stamps against the imu's
  double stamp_jitter = 0.0;        ///< s, by which single stamps are late
  double camera_rate = 0.0;         ///< Hz; zero: not known, and late stamps stay as they are
  double wheel_scale_std = 0.01;    ///< 1
  double wheel_noise = 0.05;        ///< m/s
  double track_width = 1.5;         ///< m, for four wheel speeds
  double mounting_std = 0.02;       ///< rad, pitch and yaw of the vehicle's axes in the imu's, about:
  Eigen::Vector2d mounting = Eigen::Vector2d::Zero();
  /// m, imu axes: the rear axle's centre, which does not slip and whose speed wheels tell.
  Eigen::Vector3d p_imu_axle = Eigen::Vector3d::Zero(), p_imu_axle_std = Eigen::Vector3d::Zero();
  double axle_std = 0.0;  ///< m, along the vehicle, taken for white: of a place that no wheels tell
};

/// The window of past poses and the points seen from it.
struct MsckfWindow {
  int clones = 12;                ///< poses kept
  double clone_interval = 0.07;   ///< s between two poses, at least
  int landmarks = 0;              ///< long-lived points in the state; right where errors of tracks are white (MODEL.md)
  int points_per_update = 40;     ///< finished tracks used at one time, longest first
  double sigma_px = 1.0;          ///< of a track's image coordinate
  double focal_std = 0.01;        ///< relative, of one eye's focal length; two eyes: theirs is taken as it is
  double radial_std = 0.02;       ///< coefficient of r^2 left over, of one eye
  double radial4_std = 0.05;      ///< coefficient of r^4: at the border of a picture (r^2 = 2/3) as much as that of r^2
  double gate = 0.99;             ///< probability below which a point's residual is taken for noise
  int min_sightings = 3;          ///< of a finished track
  double nearest = 0.5;           ///< m, of points from a camera
  double farthest = 1000.0;       ///< m
  double landmark_certainty = 8;  ///< inverse depth over its sigma that makes a track a landmark
};

/// Knowledge about cars; each may be left out.
struct MsckfAiding {
  bool use_wheels = true;
  bool use_sideslip = true;
  bool use_zero_velocity = true;
  bool use_planar = false;
  double wheel_interval = 0.1;       ///< s between two uses
  double sideslip_interval = 0.2;    ///< s: its errors are correlated
  double sideslip_std = 0.05;        ///< m/s, lateral, plus:
  double sideslip_per_accel = 0.02;  ///< m/s per m/s2 of lateral acceleration
  double heave_std = 0.1;            ///< m/s, vertical
  double zero_velocity_std = 0.01;   ///< m/s
  double zero_rate_std = 1.0e-3;     ///< rad/s
  double planar_slack = 0.05;        ///< rad, standard deviation of the road's slope and of body lean
  double planar_interval = 5.0;      ///< s: slopes are correlated
  double gate_sigma = 5.0;           ///< of each of these, Gaussian
  double wheel_scale_walk = 1.3e-5;  ///< 1/sqrt(s): a tyre that warms up, 1e-4 in a minute (navigation (N.2.5))
  double mounting_walk = 1.0e-5;     ///< rad/sqrt(s)
};

/// Standing, starts, loss.
struct MsckfTrust {
  double block_s = 0.5;            ///< of imu samples that say whether the car stands
  double standing_gyro = 0.01;     ///< rad/s, by which quarters of a block may differ
  double standing_accel = 0.12;    ///< m/s2
  double standing_flow_px = 1.0;   ///< of the tracks over 0.5 to 1 s, besides their noise
  double standing_speed = 0.15;    ///< m/s, the filter's own, above which it is not standing without a picture
  double max_speed = 70.0;         ///< m/s
  double max_bias_sigmas = 8.0;    ///< of an imu bias against its calibrated spread
  double refused_share = 0.75;     ///< of the points of an update; for lost_after_s: the filter is wrong
  double lost_after_s = 2.0;       ///< s
  double coasting_after_s = 1.0;   ///< s without a used point
  double invalid_sigma_mps = 2.0;  ///< of the velocity; more is no motion estimate
};

struct MsckfTuning {
  MsckfWindow window;
  MsckfAiding aiding;
  MsckfTrust trust;
};

struct MsckfConfig : MsckfTuning {
  MsckfVehicle vehicle;
};

template <class Visitor>
void visit(MsckfWindow& c, Visitor& v) {
  v.integer("clones", c.clones, 4, 16);
  v.number("clone_interval_s", c.clone_interval, 0.0, 1.0);
  v.integer("landmarks", c.landmarks, 0, 40);
  v.integer("points_per_update", c.points_per_update, 5, 200);
  v.number("sigma_px", c.sigma_px, 0.05, 10.0);
  v.number("focal_std", c.focal_std, 0.0, 0.2);
  v.number("radial_std", c.radial_std, 0.0, 0.5);
  v.number("radial4_std", c.radial4_std, 0.0, 0.5);
  v.number("gate", c.gate, 0.5, 0.9999999);
  v.integer("min_sightings", c.min_sightings, 2, 16);
  v.number("nearest_m", c.nearest, 0.01, 100.0);
  v.number("farthest_m", c.farthest, 1.0, 1e6);
  v.number("landmark_certainty", c.landmark_certainty, 1.0, 1000.0);
}

template <class Visitor>
void visit(MsckfAiding& c, Visitor& v) {
  v.boolean("use_wheels", c.use_wheels);
  v.boolean("use_sideslip", c.use_sideslip);
  v.boolean("use_zero_velocity", c.use_zero_velocity);
  v.boolean("use_planar", c.use_planar);
  v.number("wheel_interval_s", c.wheel_interval, 0.0, 10.0);
  v.number("sideslip_interval_s", c.sideslip_interval, 0.01, 10.0);
  v.number("sideslip_std_mps", c.sideslip_std, 1e-3, 10.0);
  v.number("sideslip_per_accel_s", c.sideslip_per_accel, 0.0, 1.0);
  v.number("heave_std_mps", c.heave_std, 1e-3, 10.0);
  v.number("zero_velocity_std_mps", c.zero_velocity_std, 1e-4, 1.0);
  v.number("zero_rate_std_radps", c.zero_rate_std, 1e-6, 1.0);
  v.number("planar_slack_rad", c.planar_slack, 1e-3, 1.0);
  v.number("planar_interval_s", c.planar_interval, 0.01, 1000.0);
  v.number("gate_sigma", c.gate_sigma, 1.0, 100.0);
  v.number("wheel_scale_walk_per_rts", c.wheel_scale_walk, 0.0, 1.0);
  v.number("mounting_walk_rad_per_rts", c.mounting_walk, 0.0, 1.0);
}

template <class Visitor>
void visit(MsckfTrust& c, Visitor& v) {
  v.number("block_s", c.block_s, 0.1, 10.0);
  v.number("standing_gyro_radps", c.standing_gyro, 1e-5, 1.0);
  v.number("standing_accel_mps2", c.standing_accel, 1e-4, 10.0);
  v.number("standing_flow_px", c.standing_flow_px, 0.01, 10.0);
  v.number("standing_speed_mps", c.standing_speed, 0.0, 10.0);
  v.number("max_speed_mps", c.max_speed, 1.0, 1000.0);
  v.number("max_bias_sigmas", c.max_bias_sigmas, 2.0, 1000.0);
  v.number("refused_share", c.refused_share, 0.05, 1.0);
  v.number("lost_after_s", c.lost_after_s, 0.1, 100.0);
  v.number("coasting_after_s", c.coasting_after_s, 0.1, 100.0);
  v.number("invalid_sigma_mps", c.invalid_sigma_mps, 0.01, 100.0);
}

template <class Visitor>
void visit(MsckfTuning& c, Visitor& v) {
  v.group("window", c.window);
  v.group("aiding", c.aiding);
  v.group("trust", c.trust);
}

}  // namespace roadfix
