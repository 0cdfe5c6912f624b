/// The motion since a picture taken near by: turning, from tracks whose points are not known, and a way straight on
/// whose length is told. MODEL.md (M.7b), (M.7c).
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "geometry/se3.h"

namespace roadfix {

struct ShortWayConfig {
  double focal_px = 0.0;
  double sigma_px = 0.4;                             ///< of a track's image coordinate
  double gate_px = 2.0;                              ///< of a track, above which it is an outlier
  int min_inliers = 35;                              ///< that must agree, and half of the tracks
  Eigen::Vector3d ahead = Eigen::Vector3d::UnitZ();  ///< where a car goes, camera axes, unit
};

struct ShortWay {
  SE3 T_first_second;                  ///< as long as told
  Eigen::Matrix<double, 3, 2> across;  ///< axes_across() the way, in the first picture's
  Eigen::Matrix<double, 5, 5> cov;     ///< rad2, of the direction along `across`, of the turn in the second's axes
  std::vector<bool> inlier;            ///< one per pair

  /// Of retract(T_first_second, d).
  [[nodiscard]] Matrix6d cov_pose(double length_sigma) const;
};

/// Two axes across a direction, all of unit length; the direction is the first times the second.
Eigen::Matrix<double, 3, 2> axes_across(const Eigen::Vector3d& direction);

/// (M.7b) of one track, in sigmas, and its derivatives.
struct ShortWayResidual {
  Eigen::Vector2d r;
  Eigen::Matrix<double, 2, 5> J;  ///< by the direction, along `across`, and by the turn, q exp(d)
  Eigen::Vector2d g;              ///< by inverse depth, m
};

/// `first`, `second`: the track, normalised; `q`: turn from the first picture to the second; `way`: m, in the first's
/// axes; `sigma`: of the difference.
ShortWayResidual short_way_residual(const Eigen::Vector2d& first, const Eigen::Vector2d& second,
                                    const Eigen::Quaterniond& q, const Eigen::Vector3d& way,
                                    const Eigen::Matrix<double, 3, 2>& across, double inverse_depth, double sigma);

/// Normalised coordinates of the same tracks in both pictures; `length`, m, that the camera has gone; `q_start` is the
/// turn that is expected. Nothing where the tracks do not agree, or go the other way.
std::optional<ShortWay> short_way(std::span<const Eigen::Vector2d> first, std::span<const Eigen::Vector2d> second,
                                  double length, double length_sigma, const Eigen::Quaterniond& q_start,
                                  const ShortWayConfig& config);

}  // namespace roadfix
