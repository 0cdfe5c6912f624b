/// Errors against the bounds that were claimed for them, counted so that the counts of many drives can be added: the
/// Stanford diagram (Tossaint et al., The Stanford-ESA Integrity Diagram, Navigation 54, 2007). MODEL.md (E.3.2).
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "evaluation/trajectory.h"

namespace roadfix {

/// Counts by logarithmic bins of error and bound. What is smaller than the first or larger than the last is in it.
class BoundHistogram {
 public:
  static constexpr double kFirst = 1e-3;  ///< m, lower edge of bin 0
  static constexpr int kPerDecade = 8;
  static constexpr int kBins = 7 * kPerDecade;  ///< up to 10 km

  using Cell = std::pair<int, int>;  ///< bin of the error, bin of the bound

  void add(double error, double bound);

  [[nodiscard]] static int bin(double value);
  [[nodiscard]] const std::map<Cell, int64_t>& cells() const { return cells_; }
  [[nodiscard]] int64_t samples() const { return samples_; }
  [[nodiscard]] int64_t exceeded() const { return exceeded_; }  ///< errors above their bound, exactly

 private:
  std::map<Cell, int64_t> cells_;
  int64_t samples_ = 0;
  int64_t exceeded_ = 0;
};

/// What bounds an estimate's horizontal error until it claims a protection level: three sigma along the axis in which
/// it is largest, m, the reference's own sigma added. Nothing where the covariance is not finite or not positive.
std::optional<double> horizontal_bound(const PosePair& pair, double reference_sigma);

BoundHistogram horizontal_bounds(const std::vector<PosePair>& pairs, double reference_sigma);

}  // namespace roadfix
