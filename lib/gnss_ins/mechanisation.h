/// Strapdown integration in the fixed enu frame, (M.1)-(M.8). Exact on the rotating ellipsoid: the frame turns with the
/// Earth, so Earth rate and Coriolis appear, and there is no transport rate because it does not move with the vehicle.
#pragma once

#include "gnss_ins/earth_model.h"
#include "gnss_ins/nav_state.h"
#include "samples/samples.h"

namespace roadfix {

/// R_enu_imu with a row of zeros below: a column is a vector register.
using PaddedRotation = Eigen::Matrix<double, 4, 3>;
PaddedRotation padded_rotation(const Eigen::Quaterniond& q);

/// exp(-dt / tau).
double fading(double dt, double tau);

/// One IMU interval with the state's errors taken out.
struct InertialStep {
  double dt = 0.0;                                           ///< s
  Eigen::Vector3d rate = Eigen::Vector3d::Zero();            ///< rad/s, mean, imu axes, against inertial space
  Eigen::Vector3d specific_force = Eigen::Vector3d::Zero();  ///< m/s2, mean, imu axes

  template <class Archive>
  void serialise(Archive& a) {
    a(dt, rate, specific_force);
  }
};

/// The reading without bias and scale error, (M.2).
InertialStep corrected(const NavState& x, const ImuSample& imu, double dt);

/// Moves x, whose attitude as a matrix is R, over `now`; `before` is the step ahead of it (for coning and sculling; dt
/// 0 where there is none). Returns what the specific force gave, m/s, enu axes.
Eigen::Vector3d mechanise(NavState& x, const PaddedRotation& R, const InertialStep& before, const InertialStep& now,
                          EarthModel& earth);

}  // namespace roadfix
