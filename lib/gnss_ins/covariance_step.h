/// Error covariance over several IMU samples at once, (M.9)-(M.16). The sums below are collected at every sample; the
/// transition matrix is built from them when the covariance is needed.
#pragma once

#include "gnss_ins/config.h"
#include "gnss_ins/mechanisation.h"
#include "gnss_ins/nav_state.h"

namespace roadfix {

/// R, R diag(f), R diag(rate) below each other's columns, with a row of zeros: as one aligned array, because they are
/// summed at every sample.
using RotationBlocks = Eigen::Matrix<double, 4, 9>;

/// What the transition matrix needs of the samples since the last covariance step.
struct TransitionSums {
  double duration = 0.0;                                      ///< s
  Eigen::Vector3d velocity_change = Eigen::Vector3d::Zero();  ///< sum of R f dt
  Eigen::Vector3d position_change = Eigen::Vector3d::Zero();  ///< its integral
  RotationBlocks sum = RotationBlocks::Zero();                ///< of the blocks times dt
  RotationBlocks integral = RotationBlocks::Zero();           ///< of that
  double gyro_variance = 0.0;                                 ///< sum of noise density squared times dt
  double accel_variance = 0.0;

  template <class Archive>
  void serialise(Archive& a) {
    a(duration, velocity_change, position_change, sum, integral, gyro_variance, accel_variance);
  }

  /// R: imu to enu in the middle of the step; `dv` what its specific force gave, m/s, enu axes.
  void add(const Eigen::Matrix3d& R, const Eigen::Vector3d& dv, const InertialStep& step, double gyro_density,
           double accel_density);
};

/// The transition matrix, (M.12): nine rows that other states move, and the diagonal of the rest.
struct Transition {
  Eigen::Matrix<double, 9, kInertialStates> moved;  ///< position, velocity, attitude
  ErrorVector decay;                                ///< diagonal of the states that are not moved by others
  ErrorVector noise;                                ///< their variance added

  Transition(const TransitionSums& sums, const Eigen::Vector3d& earth_rate, const GnssInsConfig& config);
  [[nodiscard]] ErrorMatrix dense() const;  ///< the whole matrix, for tests
};

/// P = Phi P Phi' + Q, symmetric to the last bit.
void propagate_covariance(ErrorMatrix& P, const Transition& phi, const TransitionSums& sums);

}  // namespace roadfix
