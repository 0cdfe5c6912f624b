#include "wheel/travel.h"

#include <cmath>

namespace roadfix {

Eigen::Vector3d travel_direction(double side, double climb) {
  return {std::cos(side) * std::cos(climb), std::sin(side) * std::cos(climb), -std::sin(climb)};
}

Eigen::Matrix<double, 3, 2> travel_direction_jacobian(double side, double climb) {
  Eigen::Matrix<double, 3, 2> J;
  J << -std::sin(side) * std::cos(climb), -std::cos(side) * std::sin(climb),  //
      std::cos(side) * std::cos(climb), -std::sin(side) * std::sin(climb),    //
      0.0, -std::cos(climb);
  return J;
}

Eigen::Vector3d wheel_acceleration(double speed, double speed_rate, const Eigen::Vector3d& omega,
                                   const Eigen::Vector3d& direction) {
  return speed_rate * direction + speed * omega.cross(direction);
}

Eigen::Vector3d lever_acceleration(const Eigen::Vector3d& p, const Eigen::Vector3d& omega,
                                   const Eigen::Vector3d& omega_rate) {
  return omega_rate.cross(p) + omega.cross(omega.cross(p));
}

}  // namespace roadfix
