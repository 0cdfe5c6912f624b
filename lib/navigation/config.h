/// What the navigation filter must be told. VehicleFacts: the calibration, one set per vehicle. NavigationTuning: one
/// set of defaults for every vehicle; a number without another source was chosen on simulated drives.
#pragma once

#include <cmath>
#include <optional>

#include "geometry/se3.h"
#include "inertial/imu_noise.h"
#include "navigation/aiding/camera/camera_facts.h"
#include "navigation/aiding/camera/camera_tuning.h"
#include "vehicle/axle_speed.h"
#include "vehicle/nonholonomic_noise.h"

namespace roadfix::navigation {

/// Facts of the sensors and of how they sit. A wide sigma says that something is to be estimated; zero: it is exact.
struct VehicleFacts {
  bool has_receiver = true;  ///< false: a start waits for no fix
  bool has_imu = true;       ///< false: the car's own motion drives the state, see without_imu()
  inertial::ImuNoise imu{1.0e-4, 1.0e-3};
  double gyro_bias_std = 1.0e-3;              ///< rad/s, at turn-on
  double accel_bias_std = 0.05;               ///< m/s2, at turn-on
  double scale_std = 1.0e-3;                  ///< of gyro and accelerometer
  double correlation_s = 3600.0;              ///< of what of biases and scales changes in a run
  std::optional<double> accel_correlation_s;  ///< of the accelerometer's biases, where it is another
  double time_offset_std = 0.0;               ///< s, imu stamp against true time
  double position_latency_std = 0.0, velocity_latency_std = 0.0, wheel_latency_std = 0.0;  ///< s
  double wheel_scale_std = 0.01;
  vehicle::WheelFacts wheels;
  double magnetic_declination = 0.0;                        ///< rad, east positive
  Eigen::Vector3d hard_iron = Eigen::Vector3d::Zero();      ///< T, subtracted from the field first
  Eigen::Matrix3d soft_iron = Eigen::Matrix3d::Identity();  ///< multiplies what is left
  Eigen::Vector2d mounting = Eigen::Vector2d::Zero();       ///< rad, pitch and yaw, prior: R_imu_vehicle = Exp(0, p, y)
  Eigen::Vector3d mounting_std = Eigen::Vector3d::Constant(0.035);  ///< rad, roll, pitch, yaw
  Eigen::Vector3d p_imu_antenna = Eigen::Vector3d::Zero(), p_imu_antenna_std = Eigen::Vector3d::Zero();  ///< m
  Eigen::Vector3d p_imu_axle = Eigen::Vector3d::Zero(), p_imu_axle_std = Eigen::Vector3d::Zero();        ///< m
  std::optional<CameraFacts> camera;

  /// False of a rig that is no part of a car, whose forward direction is unknown.
  [[nodiscard]] bool mounting_known() const { return mounting_std.tail<2>().maxCoeff() <= kMountingKnown; }
  static constexpr double kMountingKnown = 0.5;  ///< rad

  /// One for each axis whose angular rate is measured.
  [[nodiscard]] Eigen::Vector3d measured_rates() const {
    return has_imu ? Eigen::Vector3d(1.0, 1.0, 1.0) : Eigen::Vector3d(0.0, 0.0, 1.0);
  }
};

/// Latencies and clock offsets show only as differences, so one clock must define time: the better one by calibration,
/// the stamps of GNSS positions or those of the imu, (N.1.4).
struct ClockPriors {
  double imu_offset = 0.0, position_latency = 0.0, velocity_latency = 0.0, wheel_latency = 0.0;  ///< s, sigmas
  explicit ClockPriors(const VehicleFacts& v) {
    const bool gnss_defines = v.position_latency_std <= v.time_offset_std;
    (gnss_defines ? imu_offset : position_latency) = std::hypot(v.position_latency_std, v.time_offset_std);
    const double clock = gnss_defines ? v.position_latency_std : v.time_offset_std;
    velocity_latency = std::hypot(v.velocity_latency_std, clock);
    wheel_latency = std::hypot(v.wheel_latency_std, clock);
  }
};

/// Which sources are used. The same library is paper C's EKF without camera or its MSCKF without GNSS by this list.
struct SourceList {
  bool gnss_position = true;
  bool gnss_velocity = true;
  bool gnss_heading = true;
  bool wheel_speed = true;
  bool nonholonomic = true;
  bool zero_motion = true;
  bool magnetic_heading = true;
  bool camera = true;

  [[nodiscard]] bool any_gnss() const { return gnss_position || gnss_velocity || gnss_heading; }
};

/// How the state moves between measurements.
struct ProcessNoise {
  double covariance_interval = 0.05;  ///< s, longest step of the covariance
  double max_gap = 0.1;               ///< s between imu samples; longer is bridged with large noise
  double gyro_drift_max = 1.0e-3;     ///< rad/s: in-run drift of consumer MEMS gyros; the rest of the spread is turn-on
  double accel_drift_max = 0.05;      ///< m/s2, likewise
  double clock_walk = 5.0e-3;         ///< s/sqrt(s), of imu stamps that are not exact
  double wheel_scale_walk = 1.3e-5;   ///< 1/sqrt(s): what a tyre that warms up grows in a minute, (N.2.5)
  double mounting_walk = 1.0e-5;      ///< rad/sqrt(s)
  double antenna_walk = 4.0e-3;       ///< m/sqrt(s): what the imu's cross axes make of turns
};

/// How a car moves that has no imu: what nothing measures is white noise of these densities.
struct CarMotionConfig {
  double acceleration_noise = 1.5;  ///< m/s2/sqrt(Hz): half a m/s2 to three, for one to a few seconds
  double turn_noise = 0.3;      ///< rad/s/sqrt(Hz), without a yaw rate: a right angle in three seconds is three sigma
  double turn_speed = 6.0;      ///< m/s, at which it is so; slower, a curve is as narrow and takes longer
  double tilt_std = 0.04;       ///< rad, of roll and pitch: slopes of roads and lean in bends
  double tilt_time = 10.0;      ///< s, for which they last
  double level_interval = 1.0;  ///< s between two uses of the level road
  double confirm_std = 0.17;    ///< rad, of a heading that a pose may be published with
};

/// Gates, floors and intervals of the sources.
struct AidingConfig {
  double gate_sigma = 5.0;          ///< of each measurement, chi-square at this many Gaussian sigmas
  double position_floor = 0.005;    ///< m, receivers claim less
  double velocity_floor = 0.02;     ///< m/s
  double velocity_default = 0.1;    ///< m/s, where the receiver gives no sigma
  double heading_floor = 0.0017;    ///< rad
  double wheel_interval = 0.1;      ///< s
  double lateral_interval = 0.2;    ///< s between two uses of the constraint: its errors are correlated
  double vertical_interval = 1.0;   ///< s, likewise
  double zero_velocity_std = 0.02;  ///< m/s
  double zero_rate_std = 2.0e-3;    ///< rad/s
  double magnetic_std = 0.1;        ///< rad
  double magnetic_interval = 1.0;   ///< s between two uses: its errors are correlated
  bool lasting_errors = true;       ///< part of a GNSS error lasts: the Gauss-Markov states
  bool step_detection = true;       ///< of wheel scale, receiver and gyro
};

/// What a fix must say about itself.
struct GnssScreenConfig {
  double max_sigma_m = 30.0;  ///< horizontal
  int min_satellites = 4;
  double max_pdop = 10.0;
  double max_correction_age_s = 60.0;
  double hysteresis = 1.3;  ///< an accepted receiver may be this much worse (ArduPilot's EKF3 factor)
  int probation_fixes = 3;
};

/// Start and validity.
struct StartConfig {
  int headings = 24;          ///< hypotheses around the circle
  double heading_std = 0.15;  ///< rad, of each
  double confirm_probability = 0.999;
  double confirm_std = 0.052;  ///< rad
  /// rad, of a heading that is sought: known better, the pose is published. With 0.26 that is 4 s after a start in motion;
  /// but a tracker takes speed and level from it then, whose errors its map keeps.
  double rough_std = 0.052;
  double coasting_s = 3.0;         ///< s without position, velocity or standstill: coasting
  double invalid_sigma_m = 100.0;  ///< horizontal; more is no position
};

struct NavigationTuning {
  SourceList sources;
  ProcessNoise process;
  CarMotionConfig car;
  AidingConfig aiding;
  vehicle::NonholonomicConfig nonholonomic;
  GnssScreenConfig screen;
  StartConfig start;
  CameraTuning camera;
};

struct NavigationConfig : NavigationTuning {
  VehicleFacts facts;
};

template <class Visitor>
void visit(SourceList& c, Visitor& v) {
  v.boolean("gnss_position", c.gnss_position);
  v.boolean("gnss_velocity", c.gnss_velocity);
  v.boolean("gnss_heading", c.gnss_heading);
  v.boolean("wheel_speed", c.wheel_speed);
  v.boolean("nonholonomic", c.nonholonomic);
  v.boolean("zero_motion", c.zero_motion);
  v.boolean("magnetic_heading", c.magnetic_heading);
  v.boolean("camera", c.camera);
}

template <class Visitor>
void visit(ProcessNoise& c, Visitor& v) {
  v.number("covariance_interval_s", c.covariance_interval, 1e-4, 1.0);
  v.number("max_gap_s", c.max_gap, 1e-3, 10.0);
  v.number("gyro_drift_max_radps", c.gyro_drift_max, 0.0, 1.0);
  v.number("accel_drift_max_mps2", c.accel_drift_max, 0.0, 10.0);
  v.number("clock_walk_s_per_rts", c.clock_walk, 0.0, 1.0);
  v.number("wheel_scale_walk_per_rts", c.wheel_scale_walk, 0.0, 1.0);
  v.number("mounting_walk_rad_per_rts", c.mounting_walk, 0.0, 1.0);
  v.number("antenna_walk_m_per_rts", c.antenna_walk, 0.0, 1.0);
}

template <class Visitor>
void visit(CarMotionConfig& c, Visitor& v) {
  v.number("acceleration_noise_mps2_per_rthz", c.acceleration_noise, 1e-3, 100.0);
  v.number("turn_noise_radps_per_rthz", c.turn_noise, 1e-4, 10.0);
  v.number("turn_speed_mps", c.turn_speed, 0.1, 100.0);
  v.number("tilt_std_rad", c.tilt_std, 1e-4, 1.0);
  v.number("tilt_time_s", c.tilt_time, 0.1, 1e4);
  v.number("level_interval_s", c.level_interval, 0.05, 100.0);
  v.number("confirm_std_rad", c.confirm_std, 1e-4, 1.6);
}

template <class Visitor>
void visit(AidingConfig& c, Visitor& v) {
  v.number("gate_sigma", c.gate_sigma, 1.0, 100.0);
  v.number("position_floor_m", c.position_floor, 0.0, 10.0);
  v.number("velocity_floor_mps", c.velocity_floor, 0.0, 10.0);
  v.number("velocity_default_mps", c.velocity_default, 1e-3, 10.0);
  v.number("heading_floor_rad", c.heading_floor, 0.0, 1.0);
  v.number("wheel_interval_s", c.wheel_interval, 0.0, 100.0);
  v.number("lateral_interval_s", c.lateral_interval, 0.01, 100.0);
  v.number("vertical_interval_s", c.vertical_interval, 0.01, 100.0);
  v.number("zero_velocity_std_mps", c.zero_velocity_std, 1e-4, 1.0);
  v.number("zero_rate_std_radps", c.zero_rate_std, 1e-6, 1.0);
  v.number("magnetic_std_rad", c.magnetic_std, 1e-3, 3.0);
  v.number("magnetic_interval_s", c.magnetic_interval, 0.0, 1000.0);
  v.boolean("lasting_errors", c.lasting_errors);
  v.boolean("step_detection", c.step_detection);
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
void visit(StartConfig& c, Visitor& v) {
  v.integer("headings", c.headings, 1, 64);
  v.number("heading_std_rad", c.heading_std, 0.01, 3.2);
  v.number("confirm_probability", c.confirm_probability, 0.5, 1.0);
  v.number("confirm_std_rad", c.confirm_std, 1e-4, 1.6);
  v.number("rough_std_rad", c.rough_std, 1e-4, 1.6);
  v.number("coasting_s", c.coasting_s, 0.1, 1e4);
  v.number("invalid_sigma_m", c.invalid_sigma_m, 0.1, 1e6);
}

template <class Visitor>
void visit(NavigationTuning& c, Visitor& v) {
  v.group("sources", c.sources);
  v.group("process", c.process);
  v.group("car", c.car);
  v.group("aiding", c.aiding);
  v.group("nonholonomic", c.nonholonomic);
  v.group("screen", c.screen);
  v.group("start", c.start);
  v.group("camera", c.camera);
}

}  // namespace roadfix::navigation
