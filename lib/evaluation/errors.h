/// Errors of single poses and their figures per axis of the vehicle. MODEL.md (E.2.1), (E.2.2).
#pragma once

#include <optional>
#include <vector>

#include "evaluation/trajectory.h"
#include "statistics/summary.h"

namespace roadfix {

/// Estimate minus reference at one time.
struct PoseError {
  int64_t t_us = 0;
  Eigen::Vector3d position_frame = Eigen::Vector3d::Zero();    ///< m, axes of the common frame (east, north, up)
  Eigen::Vector3d position_vehicle = Eigen::Vector3d::Zero();  ///< m: longitudinal, lateral (left), vertical (up)
  /// rad: differences of roll, pitch and yaw, each wrapped. Where the reference's x axis is within 30 deg of the
  /// vertical (an imu on its side, EuRoC's rig) these mean nothing: there the turn about the frame's x, y and z.
  Eigen::Vector3d angles = Eigen::Vector3d::Zero();
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();  ///< rad, log(q_reference^-1 q_estimate), vehicle axes
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< m/s, vehicle axes (frame axes without attitude)
  Validity validity = Validity::kInvalid;

  [[nodiscard]] double norm() const { return position_frame.norm(); }
  [[nodiscard]] double horizontal() const { return position_frame.head<2>().norm(); }
};

/// What the reference holds.
struct ReferenceKind {
  bool attitude = true;
  bool velocity = true;
};

/// The vehicle's axes are the reference's where it has attitude and the estimate's otherwise.
PoseError pose_error(const PosePair& pair, const ReferenceKind& kind);
std::vector<PoseError> pose_errors(const std::vector<PosePair>& pairs, const ReferenceKind& kind);

/// Axes that PoseError::angles are about, to first order, from vehicle axes: those themselves, or the frame's where the
/// reference's x axis is within 30 deg of the vertical.
Eigen::Matrix3d R_angles_vehicle(const Eigen::Quaterniond& reference);

struct AxisErrors {
  Summary horizontal, norm;                 ///< m
  Summary longitudinal, lateral, vertical;  ///< m
  std::optional<Summary> roll, pitch, yaw;  ///< rad
  std::optional<Summary> speed;             ///< m/s, norm of the velocity error
};

AxisErrors axis_errors(const std::vector<PoseError>& errors, const ReferenceKind& kind);

}  // namespace roadfix
