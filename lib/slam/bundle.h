/// Local bundle adjustment of camera poses, points and calibration correction: Levenberg-Marquardt on the reduced
/// camera system (Triggs et al., Bundle Adjustment, 2000, section 6). MODEL.md (S.7.1)-(S.7.11).
///
/// Not Ceres, because the inverse of the reduced system is the published covariance (cost against Ceres not measured);
/// a test solves the same problem with Ceres and compares.
#pragma once

#include <vector>

#include "slam/reprojection.h"
#include "slam/standstill_constraint.h"

namespace roadfix {

/// Derivative of a pose, by retract(), with respect to the calibration correction.
using LensSensitivity = Eigen::Matrix<double, 6, LensCorrection::kSize>;

struct BundleProblem {
  struct View {
    SE3 T_map_camera;
    bool fixed = false;                                          ///< except for its dependence on the lens correction
    LensSensitivity lens_sensitivity = LensSensitivity::Zero();  ///< of a fixed view, (S.7.14)
  };
  struct Observation {
    int view = 0;
    int point = 0;
    bool right = false;  ///< observed by the right camera
    Eigen::Vector2d normalised;
  };
  /// Measured distance between two views, m, or the reference length of an initialisation.
  struct Distance {
    int view_a = 0;
    int view_b = 0;
    double distance = 0.0;
    double sigma = 0.0;
    bool measured = false;  ///< by speeds; linear cost beyond five sigmas (wheel slip)
  };

  /// Two views at a standstill: the same pose, (S.7.6).
  struct Standstill {
    int view_a = 0;
    int view_b = 0;
    StandstillSigma doubt;
  };

  std::vector<View> views;
  std::vector<Eigen::Vector3d> points;
  std::vector<Observation> observations;  ///< ascending by point, then view, left before right
  std::vector<Distance> distances;
  std::vector<Standstill> standstills;
  SE3 T_right_left;     ///< as calibrated
  LensCorrection lens;  ///< estimate
  LensCorrection lens_prior;
  LensCorrection::Matrix lens_information = LensCorrection::Matrix::Identity();  ///< of the prior
  double focal_px = 0.0;
  double sigma_px = 0.5;
  double huber = 2.0;          ///< sigmas, knee of the Huber cost
  double track_freedom = 3.0;  ///< degrees of freedom of Student's t over a track; infinite: one sigma for all
};

struct BundleReport {
  double cost_before = 0.0;  ///< half the sum of the robust squared errors
  double cost_after = 0.0;
  int iterations = 0;
  std::vector<double> error_px;          ///< one per observation, after; infinite where the point is not in front
  Matrix6d cov_last = Matrix6d::Zero();  ///< of the last view relative to the fixed ones, for independent errors
  Matrix6d clustered_cov_last = Matrix6d::Zero();   ///< the same for errors correlated along a track, (S.9.2)
  Matrix6d clustered_cov_first = Matrix6d::Zero();  ///< likewise of the first view that is not fixed
  std::vector<LensSensitivity> lens_sensitivities;  ///< one per view, relative to the fixed ones
  LensCorrection::Matrix lens_cov = LensCorrection::Matrix::Zero();
};

/// Adjusts views, points and lens; at most `max_iterations` steps, fewer once a step reduces the cost by less than
/// 1e-5.
BundleReport adjust(BundleProblem& problem, int max_iterations);

}  // namespace roadfix
