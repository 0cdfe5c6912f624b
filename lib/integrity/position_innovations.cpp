#include "integrity/position_innovations.h"

#include <algorithm>
#include <cmath>

#include "samples/samples.h"

namespace roadfix {
namespace {

constexpr double kMemory = 2.0;  // s, of the mean: a fault shows before it is followed
constexpr double kLeast = 3.0;   // innovations in the mean

}  // namespace

void PositionInnovations::add(const PositionInnovation& z) {
  noise_.add(z.t_us, z.nis, z.dof);
  const double dt = newest_us_ ? seconds_between(*newest_us_, z.t_us) : 0.0;
  newest_us_ = z.t_us;
  const double kept = std::exp(-std::max(0.0, dt) / kMemory);
  mean_ *= kept;
  weight_ *= kept;
  if (!z.accepted) {
    rejected_us_ = z.t_us;
    return;
  }
  const Eigen::Vector3d sigma = z.variance.cwiseMax(1e-12).cwiseSqrt();
  mean_ += z.innovation.cwiseQuotient(sigma);
  weight_ += 1.0;
  variance_ = z.variance;
  used_us_ = z.t_us;
}

/// The sum of n independent innovations has the sigma sqrt(n).
bool PositionInnovations::biased(double risk) const {
  if (weight_ < kLeast || !newest_us_) return false;
  const double bound = whiteness_.quantile(*newest_us_, risk) * std::sqrt(weight_);
  return (mean_.cwiseAbs().array() > bound).any();
}

void PositionInnovations::learn() {
  if (newest_us_ && weight_ >= kLeast)
    whiteness_.add(*newest_us_, mean_.squaredNorm() / weight_, static_cast<int>(mean_.size()));
}

}  // namespace roadfix
