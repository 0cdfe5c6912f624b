/// Propagation of the wheel odometry over one interval: mean and covariance (MODEL.md (W.5.1) to (W.5.8)).
#pragma once

#include <optional>

#include "inertial/earth.h"
#include "wheel/dead_reckoning.h"
#include "wheel/wheel_config.h"
#include "wheel/wheel_state.h"

namespace roadfix {

/// Inputs of one propagation interval.
struct WheelStep {
  double dt = 0.0;                                  ///< s, > 0
  Eigen::Vector3d gyro = Eigen::Vector3d::Zero();   ///< rad/s, raw
  Eigen::Vector3d accel = Eigen::Vector3d::Zero();  ///< m/s2, raw specific force
  bool standing = false;                            ///< zero speed; position and yaw are constant
  bool turning = false;                             ///< at standstill: the yaw still changes (turntable, ferry)
  std::optional<double> assumed_acceleration;       ///< m/s2, without IMU: replaces the accelerometer
  StepForm form = StepForm::kArc;
};

/// Tilt measurement from the direction of gravity. All values are means over one interval between two wheel samples, so
/// that the specific force and the wheel acceleration subtracted from it are of the same time.
struct GravityMeasurement {
  Eigen::Vector3d force = Eigen::Vector3d::Zero();  ///< m/s2, raw specific force
  Eigen::Vector3d gyro = Eigen::Vector3d::Zero();   ///< rad/s, raw
  double speed_rate = 0.0;                          ///< m/s2, wheel acceleration
  bool correct_acceleration = true;                 ///< false: Ock et al. 2020 (1), (2) with the axes corrected
  double share = 0.0;                               ///< weight of the accelerometer's angles, [0, 1]
};

struct WheelNoise {
  double gyro = 0.0;        ///< rad/s per sqrt(Hz)
  double accel = 0.0;       ///< m/s2 per sqrt(Hz)
  double gyro_walk = 0.0;   ///< rad/s per sqrt(s)
  double accel_walk = 0.0;  ///< m/s2 per sqrt(s)
  double sideslip = 0.0;    ///< rad per sqrt(Hz), direction of travel, lateral
  double heave = 0.0;       ///< rad per sqrt(Hz), direction of travel, vertical
};

/// With an IMU; the acceleration of the vehicle is noise of the accelerometer where it is not corrected.
WheelNoise process_noise(const WheelConfig& config);

/// Normal gravity differs by 0.5 % between equator and pole, 0.05 m/s2: covered by the accelerometer bias.
using inertial::kStandardGravity;

/// Mean after the interval, (W.5.1) to (W.5.4), and its Jacobian, (W.5.5), (W.5.6).
WheelVector propagated_mean(const WheelVector& x, const WheelStep& step);
WheelCovariance transition(const WheelVector& x, const WheelStep& step);

/// Reaction to gravity: specific force less bias and, where configured, less the acceleration of the vehicle (W.5.3).
Eigen::Vector3d gravity_reaction(const WheelVector& x, const GravityMeasurement& gravity);

/// Mean after the complementary filter's tilt correction, (W.1.6), and its Jacobian.
WheelVector levelled_mean(const WheelVector& x, const GravityMeasurement& gravity);
WheelCovariance levelling_jacobian(const WheelVector& x, const GravityMeasurement& gravity);

/// Mean and covariance after the interval (W.5.7).
void propagate(WheelState& state, const WheelStep& step, const WheelNoise& noise);

/// Mean and covariance after the tilt correction (W.5.8); force_sigma: white noise of the mean force, m/s2 per axis.
void update_tilt(WheelState& state, const GravityMeasurement& gravity, double force_sigma);

}  // namespace roadfix
