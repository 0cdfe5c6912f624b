/// Heading from a tilted magnetometer; derivation in MODEL.md (M.7) to (M.10).
///
/// Axes: vehicle, x forward, y left, z up; roll and pitch as in geometry/euler.h. Yaw against magnetic north is
/// counterclockwise: a car facing magnetic east has -90 deg.
#pragma once

#include <Eigen/Dense>
#include <optional>

namespace roadfix {

/// The field, turned back by roll and pitch into the level axes below the car: x level forward, y level left, z up
/// (M.8).
Eigen::Vector3d level_field(const Eigen::Vector3d& field, double roll, double pitch);

struct MagneticYaw {
  double yaw = 0.0;                                          ///< rad, of the vehicle's x against magnetic north
  Eigen::RowVector2d by_tilt = Eigen::RowVector2d::Zero();   ///< d yaw / d (roll, pitch)
  Eigen::RowVector3d by_field = Eigen::RowVector3d::Zero();  ///< d yaw / d field, rad per T
};

/// Tilt-compensated yaw with its Jacobians (M.9), (M.10); nothing where the level field vanishes (at a magnetic pole).
std::optional<MagneticYaw> magnetic_yaw(const Eigen::Vector3d& field, double roll, double pitch);

/// Heading clockwise from magnetic north by paper B's equations (5) to (7) as they are printed, in the paper's own axes
/// (x forward, y right, z down; roll right side down, pitch nose up). Wrong by 7 deg at 5 deg of roll; kept to show it.
double printed_magnetic_heading(const Eigen::Vector3d& field_frd, double roll, double pitch_nose_up);

}  // namespace roadfix
