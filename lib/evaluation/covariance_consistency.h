/// Are the published covariances consistent with the errors? NEES with the median sigma beside the median error, and
/// the share of errors within three sigma. The NEES of one drive has no band: its errors are correlated in time.
#pragma once

#include <optional>
#include <vector>

#include "evaluation/errors.h"

namespace roadfix {

/// One kind of error of one drive, (E.3.1).
struct ConsistencyRow {
  int samples = 0;
  int unusable = 0;            ///< covariances that are not positive definite
  double nees_per_dof = 0.0;   ///< mean over samples
  double median_error = 0.0;   ///< of the norm
  double median_sigma = 0.0;   ///< of the square root of the covariance's trace
  double within_3sigma = 0.0;  ///< share of single axes
};

struct CovarianceConsistency {
  ConsistencyRow position;                 ///< m, 3 axes
  ConsistencyRow horizontal;               ///< m, 2 axes
  std::optional<ConsistencyRow> attitude;  ///< rad, 3 axes
  std::optional<ConsistencyRow> pose;      ///< 6 axes; medians are those of the position
  std::optional<ConsistencyRow> velocity;  ///< m/s, 3 axes
};

/// One sample of the series that the plots show; nothing where the covariance is unusable.
struct SigmaSample {
  int64_t t_us = 0;
  Eigen::Vector3d position_vehicle = Eigen::Vector3d::Zero();  ///< sigma per axis of the vehicle, m
  Eigen::Vector3d angles = Eigen::Vector3d::Zero();            ///< sigma of roll, pitch, yaw, rad, to first order
  std::optional<double> nees_position;                         ///< per degree of freedom
  std::optional<double> nees_attitude;
};

/// `reference_sigma` is added to the position covariance: the reference's own error.
CovarianceConsistency covariance_consistency(const std::vector<PosePair>& pairs, const ReferenceKind& kind,
                                             double reference_sigma);
std::vector<SigmaSample> sigma_samples(const std::vector<PosePair>& pairs, const ReferenceKind& kind,
                                       double reference_sigma);

}  // namespace roadfix
