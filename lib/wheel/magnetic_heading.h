/// Tilt-compensated magnetic heading; derivation in MODEL.md (W.2.1) to (W.2.4).
///
/// Axes: vehicle, x forward, y left, z up; roll and pitch as in geometry/euler.h. Yaw against magnetic north is
/// counterclockwise: a car facing magnetic east has -90 deg.
#pragma once

#include <Eigen/Dense>
#include <optional>

namespace roadfix {

/// The field rotated by roll and pitch into the level axes: x level forward, y level left, z up, (W.2.2).
Eigen::Vector3d level_field(const Eigen::Vector3d& field, double roll, double pitch);

struct MagneticYaw {
  double yaw = 0.0;                                          ///< rad, of the vehicle's x against magnetic north
  Eigen::RowVector2d by_tilt = Eigen::RowVector2d::Zero();   ///< d yaw / d (roll, pitch)
  Eigen::RowVector3d by_field = Eigen::RowVector3d::Zero();  ///< d yaw / d field, rad per T
};

/// Tilt-compensated yaw with its Jacobians (W.2.3), (W.2.4); no value where the horizontal field vanishes (magnetic
/// pole).
std::optional<MagneticYaw> magnetic_yaw(const Eigen::Vector3d& field, double roll, double pitch);

/// Heading clockwise from magnetic north by equations (5) to (7) of Ock et al. 2020 as printed, in the paper's axes (x
/// forward, y right, z down; roll right side down, pitch nose up). In error by 7 deg at 5 deg of roll; kept for
/// comparison.
double printed_magnetic_heading(const Eigen::Vector3d& field_frd, double roll, double pitch_nose_up);

}  // namespace roadfix
