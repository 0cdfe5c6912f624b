/// Camera pose from observed map points: robust Gauss-Newton on the reprojection error. MODEL.md (S.4.1)-(S.4.3).
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "slam/reprojection.h"

namespace roadfix {

struct PosePoint {
  Eigen::Vector3d p_map;       ///< m
  Eigen::Vector2d normalised;  ///< observation in the left camera
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
  /// Of retract(T_map_camera, d), points assumed exact: scaled by the residuals, (S.4.3).
  Matrix6d cov = Matrix6d::Zero();
  std::vector<bool> inlier;  ///< one per point
  int num_inliers = 0;
  double rms_px = 0.0;  ///< of the inliers, per image coordinate
};

/// No value where fewer than `min_inliers` points agree.
std::optional<PoseSolution> solve_pose(std::span<const PosePoint> points, const SE3& T_map_camera_start,
                                       const PoseSolverConfig& config);

/// The same without an initial pose: three-point samples (Ke and Roumeliotis, 2017, in OpenCV) with a fixed seed, then
/// solve_pose().
std::optional<PoseSolution> search_pose(std::span<const PosePoint> points, const PoseSolverConfig& config);

}  // namespace roadfix
