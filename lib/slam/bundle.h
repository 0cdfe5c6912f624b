/// Local bundle adjustment: camera poses, points and what the calibration has wrong, so that every picture's sightings
/// fit best. Levenberg and Marquardt's method on the reduced camera system (Triggs et al., Bundle Adjustment, 2000,
/// section 6). MODEL.md (M.8)-(M.13).
///
/// Written out here instead of handed to Ceres because the reduced system's inverse is the covariance that we publish
/// (its cost against Ceres was not measured); a test solves the same problem with Ceres and compares.
#pragma once

#include <vector>

#include "slam/reprojection.h"
#include "slam/standing.h"

namespace roadfix {

/// How a pose moves, by retract(), where the lens is found to be another.
using LensPull = Eigen::Matrix<double, 6, LensCorrection::kSize>;

struct BundleProblem {
  struct View {
    SE3 T_map_camera;
    bool fixed = false;                ///< but for what it moves with the lens
    LensPull pull = LensPull::Zero();  ///< of a fixed view, (M.13c)
  };
  struct Observation {
    int view = 0;
    int point = 0;
    bool right = false;  ///< seen by the right eye
    Eigen::Vector2d normalised;
  };
  /// Metres between two views, from wheels or to fix the scale of a start.
  struct Distance {
    int view_a = 0;
    int view_b = 0;
    double distance = 0.0;
    double sigma = 0.0;
    bool measured = false;  ///< and may be far off, as a wheel slips: counts linearly beyond five sigmas
  };

  /// Two views of a car that stands: the later one is where the earlier one is, (M.8d).
  struct Standing {
    int view_a = 0;
    int view_b = 0;
    StandingDoubt doubt;
  };

  std::vector<View> views;
  std::vector<Eigen::Vector3d> points;
  std::vector<Observation> observations;  ///< ascending by point, then view, left before right
  std::vector<Distance> distances;
  std::vector<Standing> standings;
  SE3 T_right_left;     ///< as calibrated
  LensCorrection lens;  ///< what it is found to be
  LensCorrection lens_prior;
  LensCorrection::Matrix lens_information = LensCorrection::Matrix::Identity();  ///< of the prior
  double focal_px = 0.0;
  double sigma_px = 0.5;
  double huber = 2.0;          ///< sigmas beyond which an error counts linearly
  double track_freedom = 3.0;  ///< of Student's t over a track; infinite would be one sigma for all
};

struct BundleReport {
  double cost_before = 0.0;  ///< half the sum of the robust squared errors
  double cost_after = 0.0;
  int iterations = 0;
  std::vector<double> error_px;          ///< one per observation, after; infinite where the point is not in front
  Matrix6d cov_last = Matrix6d::Zero();  ///< of the last view against the fixed ones, every error on its own
  Matrix6d clustered_cov_last = Matrix6d::Zero();  ///< the same for errors that are alike along a track, (M.16)
  std::vector<LensPull> pulls;                     ///< one per view, against the fixed ones
  LensCorrection::Matrix lens_cov = LensCorrection::Matrix::Zero();
};

/// Moves views, points and lens; at most `max_iterations` steps, fewer once a step gains less than 1e-5 of the cost.
BundleReport adjust(BundleProblem& problem, int max_iterations);

}  // namespace roadfix
