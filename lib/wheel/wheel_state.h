/// State of the wheel odometry and its error (MODEL.md, section 5). All errors are additive: true = estimate + error.
#pragma once

#include <Eigen/Dense>
#include <cstdint>

#include "wheel/tilt.h"

namespace roadfix {

/// Order of the error state. From kGyroBias on: parameters. The gyro biases (at standstill) and the magnetic offset are
/// estimated; the others are considered (Schmidt): not corrected, but their covariance is propagated.
namespace wheel {
enum ErrorIndex {
  kPos = 0,             ///< m, in the level frame
  kYaw = 3,             ///< rad
  kRoll = 4,            ///< rad
  kPitch = 5,           ///< rad
  kSpeed = 6,           ///< m/s, along the direction of travel
  kGyroBias = 7,        ///< rad/s
  kAccelBias = 10,      ///< m/s2, x and y
  kWheelScale = 12,     ///< true speed / measured speed - 1
  kMountingYaw = 13,    ///< rad, direction of travel to the left of the IMU's x
  kMountingPitch = 14,  ///< rad, direction of travel below the IMU's x
  kGyroScale = 15,      ///< measured rate / true rate - 1, z axis
  kMagOffset = 16,      ///< rad, magnetic yaw minus yaw
  kWheelStates = 17
};
}  // namespace wheel

using WheelCovariance = Eigen::Matrix<double, wheel::kWheelStates, wheel::kWheelStates>;
using WheelVector = Eigen::Matrix<double, wheel::kWheelStates, 1>;

struct WheelState {
  int64_t t_us = 0;
  WheelVector x = WheelVector::Zero();
  WheelCovariance P = WheelCovariance::Zero();

  [[nodiscard]] Tilt tilt() const { return {x(wheel::kRoll), x(wheel::kPitch)}; }
  [[nodiscard]] double sigma(int index) const;
};

/// Removes the correlations of one error component and sets its standard deviation.
void decouple(WheelCovariance& P, int index, double sigma);

/// Scalar Schmidt-Kalman update with z = h(x) + noise: innovation = z - h(x), H its row. Only the components in
/// `corrected` are estimated, the others considered (Schmidt 1966, Application of state-space methods to navigation
/// problems); covariance in Joseph's form, (W.6.1).
void schmidt_update(WheelState& state, const WheelVector& H, double innovation, double variance,
                    std::initializer_list<int> corrected);

/// The same with a gain of any kind, for which Joseph's form holds as well.
void update_by_gain(WheelState& state, const WheelVector& H, const WheelVector& K, double innovation, double variance);

}  // namespace roadfix
