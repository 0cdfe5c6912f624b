/// What is known about cars as linear measurements, (M.24)-(M.29); each whitened.
#pragma once

#include "msckf/config.h"
#include "msckf/update.h"

namespace roadfix::msckf {

/// Velocity of the axle's centre, vehicle axes; `gyro`: raw.
Eigen::Vector3d vehicle_velocity(const State& state, const Eigen::Vector3d& gyro);

Linear wheel_speed(const State& state, const MsckfVehicle& vehicle, const Eigen::Vector3d& gyro, double speed);
/// Lateral and vertical; `acceleration`: lateral, m/s2.
Linear no_sideslip(const State& state, const MsckfConfig& config, const Eigen::Vector3d& gyro, double acceleration);
Linear zero_velocity(const State& state, double std);
Linear zero_rate(const State& state, const MsckfAiding& aiding, const Eigen::Vector3d& mean_gyro);
/// The vehicle is level but for the stated slack.
Linear level_road(const State& state, const MsckfAiding& aiding);

}  // namespace roadfix::msckf
