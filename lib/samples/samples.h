/// The plain structs that every estimator takes. SI units, angles in rad, axes as in geometry/frames.h. t_us:
/// microseconds since 1970-01-01 UTC.
#pragma once

#include <Eigen/Dense>
#include <array>
#include <cstdint>
#include <optional>

#include "geodesy/enu_anchor.h"
#include "geometry/se3.h"

namespace roadfix {

struct ImuSample {
  int64_t t_us = 0;                                 ///< end of the interval that the means are over
  Eigen::Vector3d gyro = Eigen::Vector3d::Zero();   ///< rad/s, mean angular rate against inertial space, imu axes
  Eigen::Vector3d accel = Eigen::Vector3d::Zero();  ///< m/s2, mean specific force, imu axes (standing level: +g on z)
};

/// The same sample in other axes: `turn` takes coordinates of its own there.
inline ImuSample in_axes(const Eigen::Quaterniond& turn, const ImuSample& s) {
  return {s.t_us, turn * s.gyro, turn * s.accel};
}

enum class FixType { kNone, kSingle, kDifferential, kRtkFloat, kRtkFixed, kDeadReckoning };
enum class HeightKind { kUnknown, kEllipsoid, kMeanSeaLevel };

struct GnssVelocity {
  Eigen::Vector3d enu = Eigen::Vector3d::Zero();      ///< m/s, of the antenna
  Eigen::Matrix3d cov_enu = Eigen::Matrix3d::Zero();  ///< m2/s2
};

/// A prior pose from outside the car: of a person, a map of parking places, a fleet's memory.
struct PriorPose {
  int64_t t_us = 0;
  Geodetic place;                                     ///< of the imu
  Eigen::Matrix3d cov_enu = Eigen::Matrix3d::Zero();  ///< m2
  double yaw = 0.0;                                   ///< rad, of the vehicle's x axis, counterclockwise from east
  double yaw_std = 0.0;                               ///< rad
};

struct GnssHeading {
  double heading = 0.0;  ///< rad, of the vehicle's x axis, clockwise from true north
  double sigma = 0.0;    ///< rad
};

struct GnssFix {
  int64_t t_us = 0;  ///< time of validity
  FixType fix_type = FixType::kNone;
  HeightKind height_kind = HeightKind::kEllipsoid;
  Geodetic antenna;                                   ///< of the phase centre
  Eigen::Matrix3d cov_enu = Eigen::Matrix3d::Zero();  ///< m2, at the antenna
  std::optional<GnssVelocity> velocity;
  std::optional<GnssHeading> heading;
  std::optional<int> num_satellites;
  std::optional<double> pdop;
  std::optional<double> correction_age;  ///< s
};

/// Signed: the speeds carry their sign. Otherwise they are magnitudes, with the gear's direction where the car gives
/// it.
enum class WheelDirection { kUnknown, kForward, kReverse, kSigned };

struct WheelSample {
  int64_t t_us = 0;
  WheelDirection direction = WheelDirection::kSigned;
  int num_speeds = 1;              ///< 1: rear axle's centre; 4: front left, front right, rear left, rear right
  std::array<double, 4> speeds{};  ///< m/s, the first num_speeds count
  std::optional<double> yaw_rate;  ///< rad/s about z up, of the car's own sensor
};

struct MagSample {
  int64_t t_us = 0;
  Eigen::Vector3d field = Eigen::Vector3d::Zero();  ///< T, vehicle axes
};

/// How far an estimate may be used.
enum class Validity { kInvalid, kCoasting, kValid };

/// A pose with velocity and covariance in some frame: what estimators give, what the fusion takes, what the evaluation
/// compares.
struct Odometry {
  int64_t t_us = 0;
  SE3 T_frame_vehicle;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();      ///< m/s, of the vehicle's origin, vehicle axes
  Eigen::Vector3d angular_rate = Eigen::Vector3d::Zero();  ///< rad/s, vehicle axes
  Matrix6d cov_pose = Matrix6d::Zero();  ///< of retract(): position in frame, rotation in vehicle axes
  Eigen::Matrix3d cov_velocity = Eigen::Matrix3d::Zero();  ///< m2/s2, vehicle axes
  Validity validity = Validity::kInvalid;
};

/// Seconds from a to b, exact up to the one rounding at the end.
inline double seconds_between(int64_t a_us, int64_t b_us) { return static_cast<double>(b_us - a_us) * 1e-6; }

}  // namespace roadfix
