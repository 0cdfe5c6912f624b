/// The axle's velocity in vehicle axes with its Jacobian by the base block, which several sources share, (N.4.5). It
/// does not depend on phi: a velocity in the vehicle's axes is free of the heading.
#pragma once

#include "navigation/filter.h"
#include "vehicle/axle_velocity.h"

namespace roadfix::navigation {

struct AxleRows {
  Eigen::Vector3d value;  ///< m/s, vehicle axes, `ahead` s after the state's epoch
  Eigen::Matrix<double, 3, kWithoutCamera> H = Eigen::Matrix<double, 3, kWithoutCamera>::Zero();
  Eigen::Vector3d gain;  ///< m/s2, its rate of change

  AxleRows(const State& state, const BodyMotion& motion, double ahead) {
    const Mean& x = state.x;
    const Eigen::Matrix3d to_imu = x.R().transpose();
    const Eigen::Vector3d a_imu = to_imu * motion.acceleration;
    const vehicle::AxleVelocity u =
        vehicle::axle_velocity(to_imu * x.nav.velocity + ahead * a_imu, motion.rate, x.mounting, x.p_imu_axle);
    value = u.value;
    gain = u.by_velocity * a_imu;
    H.middleCols<3>(kVel) = u.by_velocity * to_imu;
    H.middleCols<3>(kGyroBias) = -u.by_rate;
    H.middleCols<2>(kMounting) = u.by_mounting;
    H.middleCols<3>(kAxle) = u.by_axle;
  }
};

}  // namespace roadfix::navigation
