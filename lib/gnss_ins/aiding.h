/// What every aiding source says about the state: residual, Jacobian, covariance. Pure functions; one file each
/// (aiding_<source>.cpp), all Jacobians checked numerically. Equations (M.21)-(M.34) and (M.44) of MODEL.md.
#pragma once

#include "gnss_ins/measurement.h"

namespace roadfix {

/// BodyMotion at the state's epoch that the measurements need and the state does not hold.
struct BodyMotion {
  Eigen::Vector3d rate = Eigen::Vector3d::Zero();          ///< rad/s against the Earth, imu axes
  Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();  ///< m/s2, dv/dt, enu axes
};

/// Antenna position z (m, enu) valid `ahead` seconds after the state's epoch (with the state's own latency and offset).
Measurement<3> gnss_position(const NavState& x, const BodyMotion& motion, const Eigen::Vector3d& z,
                             const Eigen::Matrix3d& cov, double ahead);

/// Antenna velocity z (m/s, enu).
Measurement<3> gnss_velocity(const NavState& x, const BodyMotion& motion, const Eigen::Vector3d& z,
                             const Eigen::Matrix3d& cov, double ahead);

/// Yaw of the vehicle's x axis (rad, counterclockwise from east).
Measurement<1> vehicle_yaw(const NavState& x, double yaw, double sigma);

/// Forward speed of the vehicle (m/s, signed) by its wheels.
Measurement<1> wheel_speed(const NavState& x, const BodyMotion& motion, double speed, double sigma, double ahead);

/// Sideways and vertical speed of the vehicle at its rear axle: zero. R is the caller's.
Measurement<2> no_sideslip(const NavState& x, const BodyMotion& motion);

/// What the linear H of the vehicle's velocity leaves out while heading and velocity are uncertain: mean and variance
/// of its second-order terms, per vehicle axis, under the errors' covariance P, (M.44).
struct SecondOrder {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();      ///< m/s
  Eigen::Vector3d variance = Eigen::Vector3d::Zero();  ///< (m/s)^2
};
SecondOrder bent_velocity(const NavState& x, const ErrorMatrix& P);

/// Standing: velocity zero.
Measurement<3> zero_velocity(const NavState& x, double sigma);

/// Standing: the mean gyro reading is bias and Earth rate.
Measurement<3> zero_rate(const NavState& x, const Eigen::Vector3d& mean_gyro, const Eigen::Vector3d& earth_rate_enu,
                         double sigma);

/// Not accelerating by more than sigma: the mean specific force is gravity's reaction and the bias.
Measurement<3> levelling(const NavState& x, const Eigen::Vector3d& mean_accel, const Eigen::Vector3d& gravity_enu,
                         double sigma);

/// The magnetic field (any unit, vehicle axes) points to magnetic north; `declination` rad, east positive.
Measurement<1> magnetic_heading(const NavState& x, const Eigen::Vector3d& field_vehicle, double declination,
                                double sigma);

}  // namespace roadfix
