/// Strapdown mechanisation in a level frame that is fixed to the Earth, (I.1.1) to (I.1.6) of MODEL.md. The frame turns
/// with the Earth, so Earth rate and Coriolis appear; it does not move with the car, so there is no transport rate.
#pragma once

#include <Eigen/Dense>

#include "inertial/earth.h"

namespace roadfix::inertial {

/// Attitude, velocity, position of the imu in the level frame.
struct Strapdown {
  Eigen::Quaterniond q_level_imu = Eigen::Quaterniond::Identity();
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< m/s, against the Earth, level axes
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< m, imu origin
};

/// Mean readings over one interval with the estimated sensor errors taken out, (I.1.1).
struct InertialStep {
  double dt = 0.0;                                           ///< s
  Eigen::Vector3d rate = Eigen::Vector3d::Zero();            ///< rad/s against inertial space, imu axes
  Eigen::Vector3d specific_force = Eigen::Vector3d::Zero();  ///< m/s2, imu axes

  template <class Archive>
  void serialise(Archive& a) {
    a(dt, rate, specific_force);
  }
};

/// exp(-dt / tau): how much of a first-order Gauss-Markov process remains.
double gauss_markov_decay(double dt, double tau);

/// Moves x over `now`; `before` is the step ahead of it, for coning and sculling (dt 0: there is none).
void mechanise(Strapdown& x, const InertialStep& before, const InertialStep& now, Earth& earth);

}  // namespace roadfix::inertial
