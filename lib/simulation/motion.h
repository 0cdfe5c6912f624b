/// The true motion of the simulated vehicle: six uniform quintic splines over time (position in ENU, yaw, pitch, roll),
/// four times continuously differentiable. The spline *is* the truth: velocity, acceleration, angular rate and angular
/// acceleration are its exact derivatives, so what is simulated from it is consistent to rounding. Where the car
/// stands, the control points are equal and the motion is exactly zero.
#pragma once

#include <Eigen/Dense>
#include <vector>

#include "geometry/se3.h"

namespace roadfix {

/// Motion of the vehicle frame against the Earth at one time.
struct Kinematics {
  SE3 T_enu_vehicle;
  Eigen::Vector3d velocity_enu = Eigen::Vector3d::Zero();          ///< m/s, of the origin, enu axes
  Eigen::Vector3d acceleration_enu = Eigen::Vector3d::Zero();      ///< m/s2, second derivative of the position in enu
  Eigen::Vector3d angular_rate = Eigen::Vector3d::Zero();          ///< rad/s, against enu, vehicle axes
  Eigen::Vector3d angular_acceleration = Eigen::Vector3d::Zero();  ///< rad/s2, vehicle axes
};

/// East, north, up, yaw (unwrapped), pitch, roll.
using PoseCoordinates = Eigen::Matrix<double, 6, 1>;

class Motion {
 public:
  /// Samples every step_s, the first at first_s, at least seven. The spline follows them to the sixth order of step_s.
  Motion(double first_s, double step_s, const std::vector<PoseCoordinates>& samples);

  /// Motion at t_s after the start of the drive; outside [begin_s, end_s] a std::out_of_range.
  [[nodiscard]] Kinematics at(double t_s) const;

  [[nodiscard]] double begin_s() const { return begin_s_; }
  [[nodiscard]] double end_s() const { return end_s_; }

 private:
  double begin_s_;
  double end_s_;
  double step_s_;
  std::vector<PoseCoordinates> control_;
};

}  // namespace roadfix
