/// The pose of one picture from map points that it sees: robust Gauss-Newton on the reprojection error. MODEL.md
/// (M.5)-(M.7).
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "slam/reprojection.h"

namespace roadfix {

struct PosePoint {
  Eigen::Vector3d p_map;       ///< m
  Eigen::Vector2d normalised;  ///< where the left eye sees it
};

struct PoseSolverConfig {
  double focal_px = 0.0;  ///< pixels per unit of normalised coordinates
  double sigma_px = 0.5;  ///< of one image coordinate
  double gate_px = 2.0;   ///< reprojection error above which a point is an outlier
  int min_inliers = 12;
  LensCorrection lens;
};

struct PoseSolution {
  SE3 T_map_camera;
  /// Of retract(T_map_camera, d), for points known exactly: from the errors seen, (M.7).
  Matrix6d cov = Matrix6d::Zero();
  std::vector<bool> inlier;  ///< one per point
  int num_inliers = 0;
  double rms_px = 0.0;  ///< of the inliers, per image coordinate
};

/// Nothing where fewer than `min_inliers` points agree on a pose.
std::optional<PoseSolution> solve_pose(std::span<const PosePoint> points, const SE3& T_map_camera_start,
                                       const PoseSolverConfig& config);

/// The same without a start: three-point samples (Ke and Roumeliotis, 2017, in OpenCV) drawn with a fixed seed, then
/// solve_pose().
std::optional<PoseSolution> search_pose(std::span<const PosePoint> points, const PoseSolverConfig& config);

}  // namespace roadfix
