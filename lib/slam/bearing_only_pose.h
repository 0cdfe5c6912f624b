/// Motion since a nearby image from tracks without points: the rotation is estimated, the translation is the measured
/// distance along the vehicle's forward axis. MODEL.md (S.5.2), (S.5.3).
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "geometry/se3.h"

namespace roadfix {

struct BearingOnlyConfig {
  double focal_px = 0.0;
  double sigma_px = 0.4;                             ///< of a track's image coordinate
  double gate_px = 2.0;                              ///< of a track, outlier limit
  int min_inliers = 35;                              ///< minimum, and at least half of the tracks
  Eigen::Vector3d ahead = Eigen::Vector3d::UnitZ();  ///< forward axis of the vehicle, camera axes, unit
};

struct BearingOnlyPose {
  SE3 T_first_second;                  ///< with the measured distance
  Eigen::Matrix<double, 3, 2> across;  ///< perpendicular_axes() of the translation, in the first image
  Eigen::Matrix<double, 5, 5> cov;     ///< rad2, of the direction along `across` and of the rotation in the second
                                       ///< camera's axes
  std::vector<bool> inlier;            ///< one per pair

  /// Of retract(T_first_second, d).
  [[nodiscard]] Matrix6d cov_pose(double length_sigma) const;
};

/// Two unit axes perpendicular to a direction; the direction is their cross product.
Eigen::Matrix<double, 3, 2> perpendicular_axes(const Eigen::Vector3d& direction);

/// (S.5.2) of one track, normalised by sigma, and its Jacobians.
struct BearingOnlyResidual {
  Eigen::Vector2d r;
  Eigen::Matrix<double, 2, 5> J;  ///< by the direction, along `across`, and by the rotation, q exp(d)
  Eigen::Vector2d g;              ///< by inverse depth, m
};

/// `first`, `second`: the track, normalised; `q`: rotation from the first image to the second; `way`: translation, m,
/// in the first camera's axes; `sigma`: of the difference.
BearingOnlyResidual bearing_only_residual(const Eigen::Vector2d& first, const Eigen::Vector2d& second,
                                          const Eigen::Quaterniond& q, const Eigen::Vector3d& way,
                                          const Eigen::Matrix<double, 3, 2>& across, double inverse_depth,
                                          double sigma);

/// Normalised coordinates of the same tracks in both images; `length`: distance of the camera, m; `q_start`: predicted
/// rotation. No value where the tracks disagree or indicate the opposite direction.
std::optional<BearingOnlyPose> bearing_only_pose(std::span<const Eigen::Vector2d> first,
                                                 std::span<const Eigen::Vector2d> second, double length,
                                                 double length_sigma, const Eigen::Quaterniond& q_start,
                                                 const BearingOnlyConfig& config);

}  // namespace roadfix
