/// The state of the GNSS/INS filter and its error. Derivation: lib/gnss_ins/MODEL.md, cited as (M.n).
///
/// Frames: enu is fixed to the Earth at the anchor; imu axes x forward, y left, z up; vehicle axes differ from the
/// imu's by the mounting angles. Error: x = x_hat + dx, and for the attitude R_enu_imu = Exp(phi) R_hat with phi in
/// *enu* axes. Many texts have the error in imu axes; here the transition matrix becomes a plain sum over the
/// IMU samples (M.12), and outputs are converted (M.40).
#pragma once

#include <Eigen/Dense>
#include <cstdint>

namespace roadfix {

inline constexpr int kPos = 0;               ///< m, enu
inline constexpr int kVel = 3;               ///< m/s, enu
inline constexpr int kAtt = 6;               ///< rad, enu axes
inline constexpr int kGyroBias = 9;          ///< rad/s, imu axes
inline constexpr int kAccelBias = 12;        ///< m/s2, imu axes
inline constexpr int kGyroScale = 15;        ///< 1
inline constexpr int kAccelScale = 18;       ///< 1
inline constexpr int kWheelScale = 21;       ///< true speed over measured speed, minus one
inline constexpr int kMounting = 22;         ///< rad, pitch and yaw of the vehicle's axes in the imu's
inline constexpr int kPositionLatency = 24;  ///< s, age of a GNSS position at its stamp
inline constexpr int kVelocityLatency = 25;  ///< s, age of a GNSS velocity at its stamp
inline constexpr int kImuOffset = 26;        ///< s, IMU stamp minus true time
inline constexpr int kWheelLatency = 27;     ///< s, age of a wheel speed at its stamp
inline constexpr int kAxle = 28;             ///< m, imu axes: the point without sideslip, whose speed the wheels tell
inline constexpr int kAntenna = 31;          ///< m, imu axes: the GNSS antenna's phase centre
inline constexpr int kStates = 34;
inline constexpr int kInertialStates = 21;  ///< those that the mechanisation couples

using ErrorVector = Eigen::Matrix<double, kStates, 1>;
using ErrorMatrix = Eigen::Matrix<double, kStates, kStates>;

struct NavState {
  int64_t t_us = 0;                                    ///< stamp of the last IMU sample
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< m, imu origin in enu
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< m/s, against the Earth, enu axes
  Eigen::Quaterniond q_enu_imu = Eigen::Quaterniond::Identity();
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();   ///< rad/s
  Eigen::Vector3d accel_bias = Eigen::Vector3d::Zero();  ///< m/s2
  Eigen::Vector3d gyro_scale = Eigen::Vector3d::Zero();  ///< reading is (1 + scale) times the truth
  Eigen::Vector3d accel_scale = Eigen::Vector3d::Zero();
  double wheel_scale = 0.0;
  Eigen::Vector2d mounting = Eigen::Vector2d::Zero();  ///< rad: R_imu_vehicle = Exp([0, pitch, yaw])
  double position_latency = 0.0;
  double velocity_latency = 0.0;
  double imu_offset = 0.0;
  double wheel_latency = 0.0;
  Eigen::Vector3d p_imu_axle = Eigen::Vector3d::Zero();     ///< m
  Eigen::Vector3d p_imu_antenna = Eigen::Vector3d::Zero();  ///< m

  [[nodiscard]] Eigen::Matrix3d R_imu_vehicle() const;

  template <class Archive>
  void serialise(Archive& a) {
    a(t_us, position, velocity, q_enu_imu.coeffs(), gyro_bias, accel_bias, gyro_scale, accel_scale, wheel_scale,
      mounting, position_latency, velocity_latency, imu_offset, wheel_latency, p_imu_axle, p_imu_antenna);
  }
};

/// x (+) dx with the conventions above, and its inverse: retract(x, local(x, y)) == y.
NavState retract(const NavState& x, const ErrorVector& dx);
ErrorVector local(const NavState& x, const NavState& y);

}  // namespace roadfix
