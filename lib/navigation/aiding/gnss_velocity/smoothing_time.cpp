#include "navigation/aiding/gnss_velocity/smoothing_time.h"

#include <algorithm>
#include <cmath>

namespace roadfix::navigation {

namespace {

constexpr double kNone = 0.5;           // probability of no low pass, before anything is known
constexpr double kRoad = 0.01;          // s, a latency that a car's bouncing of 1.5 Hz does not show
constexpr double kMostEvidence = 27.6;  // twice the logarithm of the least probability, 1e-6: evidence can always turn

}  // namespace

SmoothingTime::SmoothingTime(double latency_std) : latency_information_(1.0 / (latency_std * latency_std)) {
  prior_.setConstant((1.0 - kNone) / (VelocityLag::kCount - 1));
  prior_(0) = kNone;
  probability_ = prior_;
}

SmoothingTime::Expected SmoothingTime::expected(const VelocityLag& lag, const Eigen::Vector3d& acceleration,
                                                const Eigen::Vector3d& acceleration_variance) const {
  Expected e;
  for (int k = 0; k < VelocityLag::kCount; ++k) {
    e.lag += probability_(k) * lag.lag(k);
    e.rate += probability_(k) * lag.rate(k, acceleration);
  }
  for (int k = 0; k < VelocityLag::kCount; ++k) {
    const Eigen::Vector3d off = lag.lag(k) - e.lag;
    e.spread += probability_(k) * off * off.transpose();
    e.spread.diagonal() += probability_(k) * VelocityLag::time(k) * VelocityLag::time(k) * acceleration_variance;
  }
  return e;
}

SmoothingTime::Each SmoothingTime::latency() const {
  return -by_latency_.array() / (information_.array() + latency_information_);
}

/// The innovation's variance holds the spread too: innovations that follow each other closely are correlated, and it
/// keeps the first of them from deciding alone. What the longest lag owes to a wrong acceleration is added for every time
/// constant alike: one that had it alone would explain whatever makes innovations large.
double SmoothingTime::learn(const AidingRecord& velocity, const VelocityLag& lag, const Eigen::Vector3d& acceleration,
                            const Eigen::Vector3d& acceleration_variance, double latency_now) {
  const Expected e = expected(lag, acceleration, acceleration_variance);
  const Eigen::Vector3d innovation = Eigen::Map<const Eigen::Vector3d>(velocity.innovation.data());
  const Eigen::Vector3d variance = Eigen::Map<const Eigen::Vector3d>(velocity.innovation_variance.data());
  // Up and down the road's unevenness shows a low pass best, but is over before a latency has passed.
  const double longest = VelocityLag::time(VelocityLag::kCount - 1);
  const int rows = latency_information_ < 1.0 / (kRoad * kRoad) ? 2 : 3;
  for (int k = 0; k < VelocityLag::kCount; ++k) {
    const Eigen::Vector3d a = lag.rate(k, acceleration);
    const Eigen::Vector3d y = innovation + e.lag - lag.lag(k) - latency_now * e.rate;
    for (int i = 0; i < rows; ++i) {
      const double S = variance(i) + longest * longest * acceleration_variance(i);
      square_(k) += y(i) * y(i) / S;
      by_latency_(k) += a(i) * y(i) / S;
      information_(k) += a(i) * a(i) / S;
    }
  }
  const Each own = latency(), before = probability_;
  Each misfit = square_.array() + own.array() * by_latency_.array() +
                (1.0 + information_.array() / latency_information_).log() - 2.0 * prior_.array().log();
  const double least = misfit.minCoeff();
  for (int k = 0; k < VelocityLag::kCount; ++k) square_(k) -= std::max(0.0, misfit(k) - least - kMostEvidence);
  probability_ = (-0.5 * (misfit.array() - least).min(kMostEvidence)).exp();
  probability_ /= probability_.sum();
  return (probability_ - before).dot(own);
}

}  // namespace roadfix::navigation
