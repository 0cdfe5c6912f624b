/// What the GNSS/INS filter must be told. The first group are facts of the vehicle (calibration, one set per drive);
/// all others are tuning with one default for every vehicle. Numbers without another source: chosen on simulated
/// drives.
#pragma once

#include <Eigen/Dense>
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
  double wheel_scale_std = 0.01;                                    ///< 1
  double wheel_noise = 0.05;                                        ///< m/s
  double track_width = 1.5;                                         ///< m, for four wheel speeds
  double magnetic_declination = 0.0;                                ///< rad, east positive
  Eigen::Vector3d mounting_std = Eigen::Vector3d::Constant(0.035);  ///< rad, roll, pitch, yaw of imu against vehicle
  Eigen::Vector3d p_imu_antenna = Eigen::Vector3d::Zero();          ///< m, imu axes
  Eigen::Vector3d p_imu_vehicle = Eigen::Vector3d::Zero();          ///< m, where wheels measure, imu axes
};

/// Gates and floors of the measurements.
struct AidingConfig {
  double gate_sigma = 5.0;          ///< of each block, by chi-square at this many Gaussian sigmas
  double position_floor = 0.005;    ///< m, receivers claim less
  double velocity_floor = 0.02;     ///< m/s
  double velocity_default = 0.1;    ///< m/s, where the receiver gives no sigma
  double heading_floor = 0.1;       ///< deg
  double sideslip_std = 0.1;        ///< m/s, of the no-sideslip constraint
  double sideslip_per_speed = 0.0;  ///< 1, added sigma per speed
  double sideslip_interval = 0.5;   ///< s between two uses: its errors are correlated
  double wheel_interval = 0.1;      ///< s
  double no_slip_x_std = 1.0;       ///< m
  double zero_velocity_std = 0.02;  ///< m/s
  double zero_rate_std = 5.0e-4;    ///< rad/s
  double zero_interval = 0.5;       ///< s
  double mag_std = 0.1;             ///< rad
  bool use_gnss_velocity = true;
  bool use_sideslip = true;
  bool use_wheels = true;
  bool use_zero_velocity = true;
  bool use_mag = true;
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
  double wheel_scale_walk = 3.0e-5;   ///< 1/sqrt(s)
  double mounting_walk = 1.0e-5;      ///< rad/sqrt(s)
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
  double block = 1.0;             ///< s of samples to level with
  int headings = 8;               ///< hypotheses around the circle
  double heading_std_deg = 20.0;  ///< of each
  double confirm_probability = 0.999;
  double confirm_std_deg = 3.0;
  double standing_accel_std = 0.3;      ///< m/s2, by which the mean specific force may miss gravity while standing
  double moving_accel_std = 1.5;        ///< m/s2, while moving
  double velocity_std_standing = 0.05;  ///< m/s
  double recovery_s = 10.0;             ///< s of refused fixes, after which the filter and not the receiver is wrong
  int recovery_fixes = 6;
  double coasting_s = 3.0;         ///< s without position, velocity or zero velocity: coasting
  double invalid_sigma_m = 100.0;  ///< horizontal; more is no position
};

struct GnssInsConfig {
  GnssInsVehicle vehicle;
  AidingConfig aiding;
  PropagationConfig propagation;
  GnssScreenConfig screen;
  AlignmentConfig alignment;
};

}  // namespace roadfix
