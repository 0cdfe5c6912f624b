#include "wheel/axle_motion.h"

#include <cmath>

namespace roadfix {

Eigen::Vector3d travel_direction(double mounting_yaw, double mounting_pitch) {
  return {std::cos(mounting_yaw) * std::cos(mounting_pitch), std::sin(mounting_yaw) * std::cos(mounting_pitch),
          -std::sin(mounting_pitch)};
}

Eigen::Matrix<double, 3, 2> travel_direction_jacobian(double mounting_yaw, double mounting_pitch) {
  Eigen::Matrix<double, 3, 2> J;
  J << -std::sin(mounting_yaw) * std::cos(mounting_pitch), -std::cos(mounting_yaw) * std::sin(mounting_pitch),  //
      std::cos(mounting_yaw) * std::cos(mounting_pitch), -std::sin(mounting_yaw) * std::sin(mounting_pitch),    //
      0.0, -std::cos(mounting_pitch);
  return J;
}

Eigen::Vector3d axle_acceleration(double speed, double speed_rate, const Eigen::Vector3d& omega,
                                  const Eigen::Vector3d& direction) {
  return speed_rate * direction + speed * omega.cross(direction);
}

Eigen::Vector3d lever_arm_acceleration(const Eigen::Vector3d& p, const Eigen::Vector3d& omega,
                                       const Eigen::Vector3d& omega_rate) {
  return omega_rate.cross(p) + omega.cross(omega.cross(p));
}

}  // namespace roadfix
