#include "evaluation/bounds.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace roadfix {

int BoundHistogram::bin(double value) {
  if (!(value > kFirst)) return 0;
  const double steps = std::log10(value / kFirst) * kPerDecade;
  return steps >= kBins ? kBins - 1 : static_cast<int>(steps);
}

void BoundHistogram::add(double error, double bound) {
  ++cells_[{bin(error), bin(bound)}];
  ++samples_;
  if (error > bound) ++exceeded_;
}

std::optional<double> horizontal_bound(const PosePair& pair, double reference_sigma) {
  const Eigen::Matrix2d cov = pair.estimate.cov_pose.topLeftCorner<2, 2>();
  if (!cov.allFinite()) return std::nullopt;
  // The larger eigenvalue of a symmetric 2x2 matrix.
  const double middle = 0.5 * (cov(0, 0) + cov(1, 1));
  const double variance = middle + std::hypot(0.5 * (cov(0, 0) - cov(1, 1)), cov(0, 1));
  if (!(variance > 0.0)) return std::nullopt;
  return 3.0 * std::sqrt(variance + reference_sigma * reference_sigma);
}

BoundHistogram horizontal_bounds(const std::vector<PosePair>& pairs, double reference_sigma) {
  BoundHistogram histogram;
  for (const PosePair& pair : pairs) {
    const Eigen::Vector3d error = pair.estimate.T_frame_vehicle.p - pair.reference.T_frame_vehicle.p;
    if (const auto bound = horizontal_bound(pair, reference_sigma)) histogram.add(error.head<2>().norm(), *bound);
  }
  return histogram;
}

}  // namespace roadfix
