/// Error covariance over several IMU samples at once, (M.9)-(M.16). The sums below are collected at every sample; the
/// transition matrix is built from them when the covariance is needed.
#pragma once

#include "gnss_ins/config.h"
#include "gnss_ins/mechanisation.h"
#include "gnss_ins/nav_state.h"

namespace roadfix {

/// The three columns of R, R diag(f), R diag(rate) beside each other, with a row of zeros: as one aligned array,
/// because they are summed at every sample.
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

  /// R: imu to enu where the step begins; `dv` what its specific force gave, m/s, enu axes.
  void add(const PaddedRotation& R, const Eigen::Vector3d& dv, const InertialStep& step, double gyro_density,
           double accel_density);
};

/// The transition matrix, (M.12): nine rows that other states move, and the diagonal of the rest.
struct Transition {
  /// Position, velocity, attitude: each column is one of their rows, with zeros up to whole vector registers.
  Eigen::Matrix<double, kInertialStates + 3, 9> moved_by;
  ErrorVector decay;  ///< diagonal of the states that are not moved by others
  ErrorVector noise;  ///< their variance added

  Transition(const TransitionSums& sums, const Eigen::Vector3d& earth_rate, const GnssInsConfig& config);
  [[nodiscard]] ErrorMatrix dense() const;  ///< the whole matrix, for tests
};

/// after = Phi P Phi' + Q, symmetric to the last bit; P and `after` may be the same.
void propagate_covariance(const ErrorMatrix& P, const Transition& phi, const TransitionSums& sums, ErrorMatrix& after);

/// Covariance of position, velocity, attitude and the IMU's clock offset.
using OutputErrorMatrix = Eigen::Matrix<double, 10, 10>;

/// The same, of these states only.
OutputErrorMatrix propagate_output_covariance(const ErrorMatrix& P, const Transition& phi, const TransitionSums& sums);

}  // namespace roadfix
