/// What the GNSS/INS filter must be told. The first group are facts of the vehicle (calibration, one set per drive);
/// all others are tuning with one default for every vehicle. Numbers without another source: chosen on simulated
/// drives.
#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <cstdint>

namespace roadfix {

/// Facts of the sensors and of how they sit; each has the key of the same name in drive.yaml.
struct GnssInsVehicle {
  double gyro_noise = 1.0e-4;                                       ///< rad/s/sqrt(Hz)
  double accel_noise = 1.0e-3;                                      ///< m/s2/sqrt(Hz)
  double gyro_bias_std = 1.0e-3;                                    ///< rad/s
  double accel_bias_std = 0.05;                                     ///< m/s2
  double scale_std = 1.0e-3;                                        ///< of gyro and accelerometer
  double correlation_s = 3600.0;                                    ///< of biases and scale factors
  double time_offset_std = 0.0;                                     ///< s, IMU stamp against true time
  double position_latency_std = 0.0;                                ///< s
  double velocity_latency_std = 0.0;                                ///< s
  double wheel_latency_std = 0.0;                                   ///< s
  double wheel_scale_std = 0.01;                                    ///< 1
  double wheel_noise = 0.05;                                        ///< m/s, each speed
  double track_width = 1.5;                                         ///< m, for four wheel speeds
  double magnetic_declination = 0.0;                                ///< rad, east positive
  Eigen::Vector3d hard_iron = Eigen::Vector3d::Zero();              ///< T, subtracted from the field first
  Eigen::Matrix3d soft_iron = Eigen::Matrix3d::Identity();          ///< multiplies what is left
  Eigen::Vector2d mounting = Eigen::Vector2d::Zero();               ///< rad, pitch and yaw: NavState
  Eigen::Vector3d mounting_std = Eigen::Vector3d::Constant(0.035);  ///< rad, roll, pitch, yaw of imu against vehicle
  Eigen::Vector3d p_imu_antenna = Eigen::Vector3d::Zero();          ///< m, imu axes
  Eigen::Vector3d p_imu_antenna_std = Eigen::Vector3d::Zero();      ///< m
  Eigen::Vector3d p_imu_axle = Eigen::Vector3d::Zero();             ///< m, where wheels measure, imu axes
  Eigen::Vector3d p_imu_axle_std = Eigen::Vector3d::Zero();         ///< m
};

/// Latencies and clock offset show only as differences, so one clock must define time: the better one by calibration,
/// the stamps of GNSS positions or those of the IMU. The pose is for its utime on that clock, (M.19).
struct TimePriors {
  double imu_offset = 0.0, position_latency = 0.0, velocity_latency = 0.0, wheel_latency = 0.0;  ///< s, sigmas
  explicit TimePriors(const GnssInsVehicle& v) {
    const bool gnss_defines = v.position_latency_std <= v.time_offset_std;
    const double both = std::hypot(v.position_latency_std, v.time_offset_std);
    (gnss_defines ? imu_offset : position_latency) = both;
    const double clock = gnss_defines ? v.position_latency_std : v.time_offset_std;
    velocity_latency = std::hypot(v.velocity_latency_std, clock);
    wheel_latency = std::hypot(v.wheel_latency_std, clock);
  }
};

/// Gates and floors of the measurements.
struct AidingConfig {
  double gate_sigma = 5.0;          ///< of each block, by chi-square at this many Gaussian sigmas
  double position_floor = 0.005;    ///< m, receivers claim less
  double velocity_floor = 0.02;     ///< m/s
  double velocity_default = 0.1;    ///< m/s, where the receiver gives no sigma
  double heading_floor = 0.1;       ///< deg
  double sideslip_interval = 0.2;   ///< s between two uses: its errors are correlated
  double heave_interval = 1.0;      ///< s, likewise, for the vertical axis
  double wheel_interval = 0.1;      ///< s
  double zero_velocity_std = 0.02;  ///< m/s
  double zero_rate_std = 2.0e-3;    ///< rad/s
  double zero_interval = 0.5;       ///< s
  double mag_std = 0.1;             ///< rad
  double mag_interval = 1.0;        ///< s between two uses: its errors are correlated
  bool use_gnss_velocity = true;
  bool use_sideslip = true;
  bool use_wheels = true;
  bool use_zero_velocity = true;
  bool use_mag = true;
  bool use_error_correlation = true;  ///< of successive GNSS positions
  bool use_return_error = true;       ///< a receiver may come back from an outage displaced
  bool use_lasting_error = true;      ///< part of a GNSS position's error is that of the one before
  bool use_scale_steps = true;        ///< the wheels' scale may change of a sudden
  bool use_second_order = true;       ///< of the vehicle's velocity, while its heading is unsure
};

/// The no-sideslip constraint's noise, one learner for each axis.
struct SideslipConfig {
  double start_std = 0.1;          ///< m/s, before anything is learnt, across
  double heave_start_std = 0.05;   ///< m/s, likewise, up: roads of class A to C give 0.02 to 0.08 (MODEL.md)
  double min_std = 0.001;          ///< m/s, the least that is used
  double max_std = 0.5;            ///< m/s
  double start_slope = 0.03;       ///< s: m/s per m/s2 of acceleration, likewise (rear slip angle at 10 m/s)
  double prior_count = 0.2;        ///< residuals that the start counts for
  double heave_prior_count = 4.0;  ///< likewise, up: with `confidence` on top 0.09 m/s at the start
  double memory_count = 400.0;     ///< residuals
  double confidence = 3.0;         ///< sigmas of the learnt variance that are added to it
  double min_speed = 2.0;          ///< m/s, to learn
};

/// How the filter moves between measurements.
struct PropagationConfig {
  double covariance_interval = 0.05;  ///< s, longest step of the covariance
  double max_gap = 0.1;               ///< s between IMU samples; longer is bridged with large noise
  double realign_gap = 10.0;          ///< s; longer starts over
  double max_gyro = 20.0;             ///< rad/s, more is not a car
  double max_accel = 200.0;           ///< m/s2
  double vibration_factor = 1.0;      ///< white noise taken from the measured sample-to-sample scatter
  double time_offset_walk = 5.0e-3;   ///< s/sqrt(s), of the IMU's stamps, where time_offset_std is not zero
  double wheel_scale_walk = 1.3e-5;   ///< 1/sqrt(s): over a minute, what a tyre grows that warms up (MODEL.md)
  double mounting_walk = 1.0e-5;      ///< rad/sqrt(s)
  double antenna_walk = 4.0e-3;       ///< m/sqrt(s), what the IMU's cross axes and its mount make of turns
};

/// What a fix must say about itself.
struct GnssScreenConfig {
  double max_sigma_m = 30.0;  ///< horizontal
  int min_satellites = 4;
  double max_pdop = 10.0;
  double max_correction_age_s = 60.0;
  double hysteresis = 1.3;  ///< a believed receiver may be this much worse (ArduPilot's EKF3 factor)
  int probation_fixes = 3;
};

/// Start, loss and recovery.
struct AlignmentConfig {
  int headings = 8;               ///< hypotheses around the circle
  double heading_std_deg = 20.0;  ///< of each
  double confirm_probability = 0.999;
  double confirm_std_deg = 3.0;
  double standing_accel_std = 0.03;     ///< m/s2, by which the mean specific force may miss gravity while standing
  double moving_accel_std = 1.5;        ///< m/s2, while moving
  double velocity_std_standing = 0.05;  ///< m/s
  double recovery_s = 10.0;             ///< s of refused fixes, after which the filter and not the receiver is wrong
  int recovery_fixes = 6;
  double jump_s = 60.0;            ///< s likewise at most, of a receiver that has jumped
  double coasting_s = 3.0;         ///< s without position, velocity or zero velocity: coasting
  double invalid_sigma_m = 100.0;  ///< horizontal; more is no position
};

/// One set for every vehicle.
struct GnssInsTuning {
  AidingConfig aiding;
  SideslipConfig sideslip;
  PropagationConfig propagation;
  GnssScreenConfig screen;
  AlignmentConfig alignment;
};

struct GnssInsConfig : GnssInsTuning {
  GnssInsVehicle vehicle;
};

template <class Visitor>
void visit(AidingConfig& c, Visitor& v) {
  v.number("gate_sigma", c.gate_sigma, 1.0, 100.0);
  v.number("position_floor_m", c.position_floor, 0.0, 10.0);
  v.number("velocity_floor_mps", c.velocity_floor, 0.0, 10.0);
  v.number("velocity_default_mps", c.velocity_default, 1e-3, 10.0);
  v.number("heading_floor_deg", c.heading_floor, 0.0, 90.0);
  v.number("sideslip_interval_s", c.sideslip_interval, 0.01, 100.0);
  v.number("heave_interval_s", c.heave_interval, 0.01, 100.0);
  v.number("wheel_interval_s", c.wheel_interval, 0.0, 100.0);
  v.number("zero_velocity_std_mps", c.zero_velocity_std, 1e-4, 1.0);
  v.number("zero_rate_std_radps", c.zero_rate_std, 1e-6, 1.0);
  v.number("zero_interval_s", c.zero_interval, 0.1, 10.0);
  v.number("mag_interval_s", c.mag_interval, 0.0, 1000.0);
  v.number("mag_std_rad", c.mag_std, 1e-3, 3.0);
  v.boolean("use_gnss_velocity", c.use_gnss_velocity);
  v.boolean("use_sideslip", c.use_sideslip);
  v.boolean("use_wheels", c.use_wheels);
  v.boolean("use_zero_velocity", c.use_zero_velocity);
  v.boolean("use_mag", c.use_mag);
  v.boolean("use_error_correlation", c.use_error_correlation);
  v.boolean("use_return_error", c.use_return_error);
  v.boolean("use_lasting_error", c.use_lasting_error);
  v.boolean("use_scale_steps", c.use_scale_steps);
  v.boolean("use_second_order", c.use_second_order);
}

template <class Visitor>
void visit(SideslipConfig& c, Visitor& v) {
  v.number("start_std_mps", c.start_std, 1e-3, 10.0);
  v.number("heave_start_std_mps", c.heave_start_std, 1e-3, 10.0);
  v.number("min_std_mps", c.min_std, 1e-4, 10.0);
  v.number("max_std_mps", c.max_std, 1e-3, 10.0);
  v.number("start_slope_s", c.start_slope, 1e-3, 10.0);
  v.number("prior_count", c.prior_count, 0.01, 1e6);
  v.number("heave_prior_count", c.heave_prior_count, 1.0, 1e6);
  v.number("memory_count", c.memory_count, 1.0, 1e6);
  v.number("confidence", c.confidence, 0.0, 100.0);
  v.number("min_speed_mps", c.min_speed, 0.0, 100.0);
}

template <class Visitor>
void visit(PropagationConfig& c, Visitor& v) {
  v.number("covariance_interval_s", c.covariance_interval, 1e-4, 1.0);
  v.number("max_gap_s", c.max_gap, 1e-3, 10.0);
  v.number("realign_gap_s", c.realign_gap, 0.1, 1e4);
  v.number("max_gyro_radps", c.max_gyro, 0.1, 100.0);
  v.number("max_accel_mps2", c.max_accel, 10.0, 1e4);
  v.number("vibration_factor", c.vibration_factor, 0.0, 100.0);
  v.number("time_offset_walk_s_per_rts", c.time_offset_walk, 0.0, 1.0);
  v.number("wheel_scale_walk_per_rts", c.wheel_scale_walk, 0.0, 1.0);
  v.number("mounting_walk_rad_per_rts", c.mounting_walk, 0.0, 1.0);
  v.number("antenna_walk_m_per_rts", c.antenna_walk, 0.0, 1.0);
}

template <class Visitor>
void visit(GnssScreenConfig& c, Visitor& v) {
  v.number("max_sigma_m", c.max_sigma_m, 0.01, 1e4);
  v.integer("min_satellites", c.min_satellites, 0, 100);
  v.number("max_pdop", c.max_pdop, 1.0, 100.0);
  v.number("max_correction_age_s", c.max_correction_age_s, 1.0, 1e4);
  v.number("hysteresis", c.hysteresis, 1.0, 10.0);
  v.integer("probation_fixes", c.probation_fixes, 1, 1000);
}

template <class Visitor>
void visit(AlignmentConfig& c, Visitor& v) {
  v.integer("headings", c.headings, 1, 64);
  v.number("heading_std_deg", c.heading_std_deg, 1.0, 180.0);
  v.number("confirm_probability", c.confirm_probability, 0.5, 1.0);
  v.number("confirm_std_deg", c.confirm_std_deg, 0.01, 90.0);
  v.number("standing_accel_std_mps2", c.standing_accel_std, 1e-3, 10.0);
  v.number("moving_accel_std_mps2", c.moving_accel_std, 1e-3, 10.0);
  v.number("velocity_std_standing_mps", c.velocity_std_standing, 1e-3, 10.0);
  v.number("recovery_s", c.recovery_s, 0.1, 1e4);
  v.integer("recovery_fixes", c.recovery_fixes, 1, 1000);
  v.number("jump_s", c.jump_s, 0.1, 1e4);
  v.number("coasting_s", c.coasting_s, 0.1, 1e4);
  v.number("invalid_sigma_m", c.invalid_sigma_m, 0.1, 1e6);
}

template <class Visitor>
void visit(GnssInsTuning& c, Visitor& v) {
  v.group("aiding", c.aiding);
  v.group("sideslip", c.sideslip);
  v.group("propagation", c.propagation);
  v.group("screen", c.screen);
  v.group("alignment", c.alignment);
}

}  // namespace roadfix
