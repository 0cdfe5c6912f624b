#include "evaluation/covariance_consistency.h"

#include <cmath>

#include "evaluation/errors.h"
#include "geometry/so3.h"
#include "statistics/consistency.h"

namespace roadfix {
namespace {

/// The error that pose_t's covariance describes: local(estimate, reference), the position's part widened by the
/// reference's own sigma.
struct Normalised {
  Vector6d error;
  Matrix6d cov;
};

Normalised normalised(const PosePair& pair, double reference_sigma) {
  Normalised n;
  n.error = local(pair.estimate.T_frame_vehicle, pair.reference.T_frame_vehicle);
  n.cov = pair.estimate.cov_pose;
  n.cov.topLeftCorner<3, 3>().diagonal().array() += reference_sigma * reference_sigma;
  return n;
}

class ConsistencySum {
 public:
  /// Median error and sigma are taken from the first `shown` axes.
  void add(const Eigen::VectorXd& error, const Eigen::MatrixXd& cov, int shown) {
    const auto value = normalised_square(error, cov);
    if (!value) {
      ++row_.unusable;
      return;
    }
    accumulator_.add(*value, static_cast<int>(error.size()));
    errors_.push_back(error.head(shown).norm());
    sigmas_.push_back(std::sqrt(cov.diagonal().head(shown).sum()));
    for (Eigen::Index i = 0; i < error.size(); ++i) {
      ++axes_;
      if (error(i) * error(i) <= 9.0 * cov(i, i)) ++within_;
    }
  }

  [[nodiscard]] ConsistencyRow row() const {
    ConsistencyRow row = row_;
    row.samples = accumulator_.count();
    row.nees_per_dof = accumulator_.ratio();
    row.median_error = median(errors_);
    row.median_sigma = median(sigmas_);
    row.within_3sigma = axes_ == 0 ? 0.0 : static_cast<double>(within_) / axes_;
    return row;
  }

 private:
  ConsistencyRow row_;
  ConsistencyAccumulator accumulator_;
  std::vector<double> errors_, sigmas_;
  int axes_ = 0;
  int within_ = 0;
};

}  // namespace

CovarianceConsistency covariance_consistency(const std::vector<PosePair>& pairs, const ReferenceKind& kind,
                                             double reference_sigma) {
  ConsistencySum position, horizontal, attitude, pose, velocity;
  for (const PosePair& pair : pairs) {
    const Normalised n = normalised(pair, reference_sigma);
    position.add(n.error.head<3>(), n.cov.topLeftCorner<3, 3>(), 3);
    horizontal.add(n.error.head<2>(), n.cov.topLeftCorner<2, 2>(), 2);
    if (kind.attitude) {
      attitude.add(n.error.tail<3>(), n.cov.bottomRightCorner<3, 3>(), 3);
      pose.add(n.error, n.cov, 3);
    }
    if (kind.velocity && kind.attitude) {
      velocity.add(pose_error(pair, kind).velocity, pair.estimate.cov_velocity, 3);
    }
  }
  CovarianceConsistency out;
  out.position = position.row();
  out.horizontal = horizontal.row();
  if (kind.attitude) {
    out.attitude = attitude.row();
    out.pose = pose.row();
  }
  if (kind.velocity && kind.attitude) out.velocity = velocity.row();
  return out;
}

std::vector<SigmaSample> sigma_samples(const std::vector<PosePair>& pairs, const ReferenceKind& kind,
                                       double reference_sigma) {
  std::vector<SigmaSample> samples;
  samples.reserve(pairs.size());
  for (const PosePair& pair : pairs) {
    const Normalised n = normalised(pair, reference_sigma);
    const Eigen::Matrix3d R_frame_vehicle =
        kind.attitude ? pair.reference.T_frame_vehicle.R() : pair.estimate.T_frame_vehicle.R();
    const Eigen::Matrix3d cov_position = n.cov.topLeftCorner<3, 3>();
    const Eigen::Matrix3d cov_attitude = n.cov.bottomRightCorner<3, 3>();
    SigmaSample s;
    s.t_us = pair.reference.t_us;
    s.position_vehicle = (R_frame_vehicle.transpose() * cov_position * R_frame_vehicle).diagonal().cwiseSqrt();
    const Eigen::Matrix3d R_angles = R_angles_vehicle(pair.reference.T_frame_vehicle.q);
    s.angles = (R_angles * cov_attitude * R_angles.transpose()).diagonal().cwiseSqrt();
    if (const auto value = normalised_square(n.error.head<3>(), cov_position)) s.nees_position = *value / 3.0;
    if (kind.attitude) {
      if (const auto value = normalised_square(n.error.tail<3>(), cov_attitude)) s.nees_attitude = *value / 3.0;
    }
    samples.push_back(s);
  }
  return samples;
}

}  // namespace roadfix
