/// Error covariance over several IMU samples at once, (M.9)-(M.16). The sums below are collected at every sample; the
/// transition matrix is built from them when the covariance is needed.
#pragma once

#include "gnss_ins/config.h"
#include "gnss_ins/mechanisation.h"
#include "gnss_ins/nav_state.h"

namespace roadfix {

/// What the transition matrix needs of the samples since the last covariance step.
struct TransitionSums {
  double duration = 0.0;                                      ///< s
  Eigen::Vector3d velocity_change = Eigen::Vector3d::Zero();  ///< sum of R f dt
  Eigen::Vector3d position_change = Eigen::Vector3d::Zero();  ///< its integral
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Zero();         ///< sum of R dt
  Eigen::Matrix3d rotation2 = Eigen::Matrix3d::Zero();        ///< its integral
  Eigen::Matrix3d rotation_rate = Eigen::Matrix3d::Zero();    ///< sum of R diag(rate) dt
  Eigen::Matrix3d rotation_force = Eigen::Matrix3d::Zero();   ///< sum of R diag(f) dt
  Eigen::Matrix3d rotation_force2 = Eigen::Matrix3d::Zero();  ///< its integral
  double gyro_variance = 0.0;                                 ///< sum of noise density squared times dt
  double accel_variance = 0.0;

  template <class Archive>
  void serialise(Archive& a) {
    a(duration, velocity_change, position_change, rotation, rotation2, rotation_rate, rotation_force, rotation_force2,
      gyro_variance, accel_variance);
  }

  void add(const Eigen::Matrix3d& R, const InertialStep& step, double gyro_density, double accel_density);
};

/// The blocks of the transition matrix that are neither zero nor identity, (M.12).
struct Transition {
  double duration = 0.0;
  Eigen::Matrix3d pos_vel, vel_vel, att_att;
  Eigen::Matrix3d pos_att, vel_att;
  Eigen::Matrix<double, 3, 12> pos_imu, vel_imu, att_imu;  ///< gyro bias, accel bias, gyro scale, accel scale
  ErrorVector decay;                                       ///< diagonal of the states that are not moved by others
  ErrorVector noise;                                       ///< their variance added

  Transition(const TransitionSums& sums, const Eigen::Vector3d& earth_rate, const GnssInsConfig& config);
  [[nodiscard]] ErrorMatrix dense() const;  ///< the whole matrix, for tests
};

/// P = Phi P Phi' + Q, symmetric to the last bit.
void propagate_covariance(ErrorMatrix& P, const Transition& phi, const TransitionSums& sums);

}  // namespace roadfix
