/// Strapdown integration of the means and, over any number of samples, one step of the covariance, (M.2)-(M.9).
#pragma once

#include "msckf/config.h"
#include "msckf/state.h"

namespace roadfix::msckf {

using Matrix9d = Eigen::Matrix<double, 9, 9>;

class Propagation {
 public:
  explicit Propagation(const MsckfVehicle& vehicle);

  /// Carries `x` on by `dt` s of mean rate and specific force, raw readings.
  void step(ImuState& x, const Eigen::Vector3d& gyro, const Eigen::Vector3d& accel, double dt);

  /// (phi, nu, rho) after the steps by the imu's errors (kImuSize) before them.
  [[nodiscard]] Eigen::Matrix<double, 9, kImuSize> transition() const;
  [[nodiscard]] const Matrix9d& noise() const { return Q_; }
  [[nodiscard]] double elapsed() const { return T_; }

  /// Moves the covariance over the steps taken and begins anew.
  void apply(State& state, const MsckfAiding& aiding);
  void clear();

 private:
  double gravity_, gyro_noise_, accel_noise_;  ///< m/s2 and densities
  double gyro_walk_, accel_walk_;              ///< of the biases, per sqrt(s)
  double T_ = 0.0, turned_angle_ = 0.0;
  // Columns by gyro bias and gyro scale (0..2, 3..5), accelerometer bias and scale.
  Eigen::Matrix<double, 3, 6> att_gyro_ = Eigen::Matrix<double, 3, 6>::Zero();
  Eigen::Matrix<double, 3, 6> vel_gyro_ = Eigen::Matrix<double, 3, 6>::Zero();
  Eigen::Matrix<double, 3, 6> pos_gyro_ = Eigen::Matrix<double, 3, 6>::Zero();
  Eigen::Matrix<double, 3, 6> vel_accel_ = Eigen::Matrix<double, 3, 6>::Zero();
  Eigen::Matrix<double, 3, 6> pos_accel_ = Eigen::Matrix<double, 3, 6>::Zero();
  Matrix9d Q_ = Matrix9d::Zero();
};

}  // namespace roadfix::msckf
