/// State of the wheel odometry and its error (MODEL.md, section 5). All errors are additive: true = estimate + error.
#pragma once

#include <Eigen/Dense>

#include "wheel/tilt.h"

namespace roadfix {

/// Order of the error state. From kGyroBias on: parameters; of them only the gyro biases are estimated (standing), and
/// the magnetic offset; the others are considered: they never change, but their uncertainty counts.
namespace wheel {
enum ErrorIndex {
  kPos = 0,          ///< m, in the level frame
  kYaw = 3,          ///< rad
  kRoll = 4,         ///< rad
  kPitch = 5,        ///< rad
  kSpeed = 6,        ///< m/s, along the direction of travel
  kGyroBias = 7,     ///< rad/s
  kAccelBias = 10,   ///< m/s2, x and y
  kWheelScale = 12,  ///< true speed / measured speed - 1
  kSide = 13,        ///< rad, direction of travel to the left of the imu's x
  kClimb = 14,       ///< rad, direction of travel below the imu's x
  kGyroScale = 15,   ///< measured rate / true rate - 1, z axis
  kMagOffset = 16,   ///< rad, magnetic yaw minus yaw
  kWheelStates = 17
};
}  // namespace wheel

using WheelCovariance = Eigen::Matrix<double, wheel::kWheelStates, wheel::kWheelStates>;
using WheelVector = Eigen::Matrix<double, wheel::kWheelStates, 1>;

struct WheelState {
  WheelVector x = WheelVector::Zero();
  WheelCovariance P = WheelCovariance::Zero();

  [[nodiscard]] Tilt tilt() const { return {x(wheel::kRoll), x(wheel::kPitch)}; }
  [[nodiscard]] double sigma(int index) const;
};

/// Sets one component's error to be independent of all others, with the given standard deviation.
void decouple(WheelCovariance& P, int index, double sigma);

/// Fuses the scalar z = h(x) + noise of the given variance: innovation = z - h(x), H its row. Only the components in
/// `corrected` change; the others are considered (Schmidt, Application of state-space methods to navigation problems,
/// 1966), and P stays honest for that (Joseph's form), (M.26).
void schmidt_update(WheelState& state, const WheelVector& H, double innovation, double variance,
                    std::initializer_list<int> corrected);

}  // namespace roadfix
