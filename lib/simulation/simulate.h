/// One simulated drive: what the sensors measured, what was true, and every error exactly.
///
/// Frames: enu at `anchor`; vehicle as frames.h, origin at the rear axle's centre on the ground (the imu sits at
/// config.imu.position_m in it, the origin itself by default). Gravity is normal gravity of WGS84, and the Earth turns.
///
/// The imu is a perfect strapdown sensor plus errors: gyro is the mean over the interval of the angular rate against
/// inertial space, in the axes that the imu has at each instant; accel is the mean of the specific force, likewise in
/// the instantaneous axes. Both are integrals of the truth by three-point Gauss quadrature, divided by the interval. No
/// coning or sculling correction is in them: that is the mechanisation's work.
///
/// The same configuration and seed give the same bytes. Every noise source has its own random stream.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "geodesy/enu_anchor.h"
#include "samples/samples.h"
#include "simulation/motion.h"
#include "simulation/scenario_config.h"

namespace roadfix {

/// The imu's biases over the interval of the sample with the same index, imu axes.
struct ImuBias {
  Eigen::Vector3d gyro = Eigen::Vector3d::Zero();   ///< rad/s, turn-on and drift
  Eigen::Vector3d accel = Eigen::Vector3d::Zero();  ///< m/s2
};

/// Measured minus true of the fix with the same index, enu axes at the antenna.
struct GnssError {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< m, faults included; the effect of latency is not in it
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< m/s
  double heading = 0.0;                                ///< rad
};

/// What faults do to one picture besides its transmission.
struct PictureEffects {
  double light_factor = 1.0;     ///< on the light that falls in
  double glare = 0.0;            ///< light added, in shares of full scale
  double noise_factor = 1.0;     ///< on the standard deviation
  double occluded_share = 0.0;   ///< of the width, from the left
  std::uint64_t corruption = 0;  ///< not 0: the file is damaged; seeds where
};

/// One picture as a camera gives it.
struct Picture {
  std::int64_t t_us = 0;     ///< stamp
  std::size_t exposure = 0;  ///< which of SimulatedDrive::exposures it shows
  PictureEffects effects;
};

/// How the sample with the same index came about and reached the log.
struct Delivery {
  std::int64_t seq = 0;         ///< counts what the sensor sent: a message lost in transmission leaves a gap
  std::int64_t true_us = 0;     ///< when it was measured; its stamp may differ
  std::int64_t arrival_us = 0;  ///< when it was received
};

struct Deliveries {
  std::vector<Delivery> imu, gnss, wheels, mag, camera_left, camera_right;
};

struct SimulationErrors {
  std::vector<ImuBias> imu_bias;                         ///< one per imu sample
  std::vector<GnssError> gnss;                           ///< one per fix
  Eigen::Vector3d gyro_scale = Eigen::Vector3d::Zero();  ///< measured = (1 + scale) true, each axis
  Eigen::Vector3d accel_scale = Eigen::Vector3d::Zero();
  Eigen::Quaterniond q_vehicle_imu = Eigen::Quaterniond::Identity();  ///< true mounting
  Eigen::Vector3d gnss_lever_arm = Eigen::Vector3d::Zero();           ///< m, true, vehicle axes
  std::array<double, 4> wheel_scale{};                                ///< measured / true - 1; one speed: the first
  double yaw_rate_bias = 0.0;                                         ///< rad/s, of the car's own sensor
  Eigen::Vector3d hard_iron = Eigen::Vector3d::Zero();                ///< T, true
  Eigen::Matrix3d soft_iron = Eigen::Matrix3d::Identity();            ///< measured = soft_iron * field + hard_iron
  SE3 T_vehicle_left;                                                 ///< true place of the left camera
};

struct SimulatedDrive {
  ScenarioConfig config;  ///< what a calibration would hold: nominal values and their sigmas
  std::uint64_t seed = 0;
  EnuAnchor anchor{Geodetic{}};
  std::shared_ptr<const Motion> motion;

  std::vector<ImuSample> imu;
  std::vector<GnssFix> gnss;
  std::vector<WheelSample> wheels;
  std::vector<MagSample> mag;
  std::vector<std::int64_t> exposures;  ///< true times of the middle of the cameras' exposures, microseconds, UTC
  std::vector<Picture> pictures_left;   ///< what arrives of them, without pixels: scene/film.h draws those
  std::vector<Picture> pictures_right;
  std::vector<Odometry> truth;  ///< at config.truth_rate_hz, exact, covariance zero, T_frame_vehicle in enu
  SimulationErrors errors;
  Deliveries deliveries;  ///< per sample, in order of measurement; not of arrival

  /// The truth at any time of the drive.
  [[nodiscard]] Odometry truth_at(std::int64_t t_us) const;
  [[nodiscard]] Kinematics kinematics_at(std::int64_t t_us) const;
};

SimulatedDrive simulate(const ScenarioConfig& config, std::uint64_t seed);

}  // namespace roadfix
