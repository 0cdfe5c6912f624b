#include "navigation/aiding/gnss_velocity/smoothing_time.h"

#include <algorithm>
#include <cmath>

namespace roadfix::navigation {

namespace {

constexpr double kNone = 0.5;    // probability of no low pass, before anything is known
constexpr double kLeast = 1e-6;  // of each: evidence can always turn

}  // namespace

SmoothingTime::SmoothingTime() {
  probability_.setConstant((1.0 - kNone) / (VelocityLag::kCount - 1));
  probability_(0) = kNone;
}

SmoothingTime::Expected SmoothingTime::expected(const VelocityLag& lag, const Eigen::Vector3d& acceleration) const {
  Expected e;
  for (int k = 0; k < VelocityLag::kCount; ++k) {
    e.lag += probability_(k) * lag.lag(k);
    e.rate += probability_(k) * lag.rate(k, acceleration);
  }
  for (int k = 0; k < VelocityLag::kCount; ++k) {
    const Eigen::Vector3d off = lag.lag(k) - e.lag;
    e.spread += probability_(k) * off * off.transpose();
  }
  return e;
}

/// The innovation's variance holds the spread too: innovations that follow each other closely are correlated, and it
/// keeps the first of them from deciding alone.
void SmoothingTime::learn(const AidingRecord& velocity, const VelocityLag& lag) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (int k = 0; k < VelocityLag::kCount; ++k) mean += probability_(k) * lag.lag(k);
  const Eigen::Vector3d innovation = Eigen::Map<const Eigen::Vector3d>(velocity.innovation.data());
  const Eigen::Vector3d variance = Eigen::Map<const Eigen::Vector3d>(velocity.innovation_variance.data());
  Eigen::Matrix<double, VelocityLag::kCount, 1> square;
  for (int k = 0; k < VelocityLag::kCount; ++k) {
    const Eigen::Vector3d off = innovation + mean - lag.lag(k);
    square(k) = (off.array().square() / variance.array()).sum();
  }
  const double least = square.minCoeff();
  double sum = 0.0;
  for (int k = 0; k < VelocityLag::kCount; ++k) {
    probability_(k) = std::max(kLeast, probability_(k) * std::exp(-0.5 * (square(k) - least)));
    sum += probability_(k);
  }
  probability_ /= sum;
}

}  // namespace roadfix::navigation
