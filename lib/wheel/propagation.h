/// One interval of the wheel odometry: mean and covariance (MODEL.md (M.18) to (M.25)).
#pragma once

#include <optional>

#include "wheel/dead_reckoning.h"
#include "wheel/wheel_state.h"

namespace roadfix {

/// What drives the state through one interval.
struct WheelStep {
  double dt = 0.0;                                  ///< s, > 0
  Eigen::Vector3d gyro = Eigen::Vector3d::Zero();   ///< rad/s, raw
  Eigen::Vector3d accel = Eigen::Vector3d::Zero();  ///< m/s2, raw specific force
  bool standing = false;                            ///< position and yaw do not move, speed is zero
  bool turning = false;                             ///< while standing: the yaw moves nevertheless
  std::optional<double> blind_acceleration;         ///< m/s2: no imu; accel is not used
  StepForm form = StepForm::kArc;
};

/// What levels the tilt: means over one interval of the wheels, so that the force and the wheels' acceleration, which
/// is taken off it, are of the same time. A lag of 50 ms would kick the pitch by 3 mrad at every start and stop.
struct PlumbLine {
  Eigen::Vector3d force = Eigen::Vector3d::Zero();  ///< m/s2, raw specific force
  Eigen::Vector3d gyro = Eigen::Vector3d::Zero();   ///< rad/s, raw
  double speed_rate = 0.0;                          ///< m/s2, of the wheels
  bool correct_acceleration = true;                 ///< false: paper B (1), (2) with the right axes
  double share = 0.0;                               ///< of the accelerometer's angles
};

struct WheelNoise {
  double gyro = 0.0;        ///< rad/s per sqrt(Hz)
  double accel = 0.0;       ///< m/s2 per sqrt(Hz)
  double gyro_walk = 0.0;   ///< rad/s per sqrt(s)
  double accel_walk = 0.0;  ///< m/s2 per sqrt(s)
  double side = 0.0;        ///< rad per sqrt(Hz)
  double climb = 0.0;       ///< rad per sqrt(Hz)
};

/// Normal gravity differs by 0.5 % between equator and pole, 0.05 m/s2: within the accelerometer's bias.
inline constexpr double kStandardGravity = 9.80665;

/// Mean after the interval (M.18) to (M.21) and its Jacobian by x (M.22), (M.23).
WheelVector propagated_mean(const WheelVector& x, const WheelStep& step);
WheelCovariance transition(const WheelVector& x, const WheelStep& step);

/// Force left for the plumb line: raw, less bias, less the wheels' acceleration where asked for (M.20).
Eigen::Vector3d plumb_force(const WheelVector& x, const PlumbLine& plumb);

/// Mean with roll and pitch drawn to the plumb line, (M.5), and its Jacobian by x.
WheelVector levelled_mean(const WheelVector& x, const PlumbLine& plumb);
WheelCovariance levelling(const WheelVector& x, const PlumbLine& plumb);

/// Mean and covariance after the interval (M.24), (M.25).
void propagate(WheelState& state, const WheelStep& step, const WheelNoise& noise);

/// Mean and covariance after levelling; force_sigma: white error of the mean force, m/s2 per axis.
void level(WheelState& state, const PlumbLine& plumb, double force_sigma);

}  // namespace roadfix
