#include "gnss_ins/sideslip.h"

#include <algorithm>
#include <cmath>

namespace roadfix {

namespace {

constexpr double kMostRatio = 16.0;  // a residual counts at most as four sigma
constexpr double kMostCorrelation = 0.9;

}  // namespace

SideslipNoise::SideslipNoise(const SideslipConfig& config)
    : config_(config), count_(config.prior_count), variance_(config.start_std * config.start_std) {}

double SideslipNoise::growth(double lateral_acceleration) const {
  return 1.0 + std::abs(lateral_acceleration) / config_.doubling_accel;
}

double SideslipNoise::sigma(double lateral_acceleration) const {
  const double correlation = square_ > 0.0 ? std::clamp(product_ / square_, 0.0, kMostCorrelation) : 0.0;
  const double inflation = (1.0 + correlation) / (1.0 - correlation);
  // What is left after the filter's own uncertainty is taken off is a small difference of large numbers: its own
  // standard deviation, with as many independent residuals as there are, goes on top.
  const double doubt =
      config_.confidence * std::sqrt(2.0 * inflation / count_) * (explained_ + std::max(variance_, 0.0));
  const double variance = std::max(variance_, 0.0) * inflation + doubt;
  return growth(lateral_acceleration) * std::clamp(std::sqrt(variance), config_.min_std, config_.max_std);
}

void SideslipNoise::learn(double residual, double predicted_variance, double lateral_acceleration) {
  const double scale = growth(lateral_acceleration);
  const double expected = std::max(variance_, config_.min_std * config_.min_std) + predicted_variance / (scale * scale);
  const double bound = std::sqrt(kMostRatio * expected);
  const double r = std::clamp(residual / scale, -bound, bound);
  count_ = std::min(count_ + 1.0, config_.memory_count);
  const double weight = 1.0 / count_;
  variance_ += weight * (r * r - predicted_variance / (scale * scale) - variance_);
  explained_ += weight * (predicted_variance / (scale * scale) - explained_);
  square_ += weight * (r * r - square_);
  product_ += weight * (r * last_ - product_);
  last_ = r;
}

}  // namespace roadfix
