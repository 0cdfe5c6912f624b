#include "gnss_ins/sideslip.h"

#include <algorithm>
#include <cmath>

namespace roadfix {

namespace {

constexpr double kMostRatio = 16.0;  // a residual counts at most as four sigma
constexpr double kMostCorrelation = 0.9;
// So that both can grow again: a tenth of the least that is used, and of what tyres slip at walking pace (3.6 mrad per
// m/s2, config.h).
constexpr double kLeastLearnt = 1.0e-4;  // m/s
constexpr double kLeastSlope = 2.0e-4;   // s

}  // namespace

void LearntVariance::learn(double seen, double noise, double scale, double independent, double memory) {
  // What one square tells about a variance s in it is 1 / (2 (s + noise)^2): where the rest is large it tells little,
  // and what was known before stays.
  const double told = value_ * scale / (value_ * scale + noise);
  const double counts = told * told * independent;
  if (counts <= 0.0) return;
  count_ = std::min(count_ + counts, memory);
  value_ = std::max(value_ + counts / count_ * ((seen - noise) / scale - value_), least_);
}

double LearntVariance::careful(double confidence) const {
  return value_ * (1.0 + confidence * std::sqrt(2.0 / count_));
}

SideslipNoise::SideslipNoise(const SideslipConfig& config, double start_std, double prior_count)
    : config_(config),
      straight_(start_std, kLeastLearnt, prior_count),
      slope_(config.start_slope, kLeastSlope, prior_count) {}

double SideslipNoise::correlation() const { return std::clamp(product_ - persisting_, 0.0, kMostCorrelation); }

double SideslipNoise::sigma(double acceleration) const {
  const double inflation = (1.0 + correlation()) / (1.0 - correlation());
  const double square = acceleration * acceleration;
  const double variance = straight_.careful(config_.confidence) + square * slope_.careful(config_.confidence);
  return std::clamp(std::sqrt(inflation * variance), config_.min_std, config_.max_std);
}

void SideslipNoise::learn(const SideslipResidual& seen, double acceleration) {
  const double square = acceleration * acceleration;
  const double straight = straight_.value(), turning = square * slope_.value();
  const double slip = straight + turning;
  const double r2 = std::min(seen.value * seen.value, kMostRatio * (slip + seen.explained));
  const double alike = correlation() * correlation();
  const double independent = (1.0 - alike) / (1.0 + alike);  // Bartlett 1946
  straight_.learn(r2, turning + seen.explained, 1.0, independent, config_.memory_count);
  if (square > 0.0) slope_.learn(r2, straight + seen.explained, square, independent, config_.memory_count);

  const double unit = std::copysign(std::sqrt(r2 / slip), seen.value);
  seen_ = std::min(seen_ + 1.0, config_.memory_count);
  product_ += (unit * last_ - product_) / seen_;
  persisting_ += (last_persisting_ - persisting_) / seen_;
  last_ = unit;
  // The update takes the share `gain` of its error out of the filter and puts that share of the slip in.
  const double gain = seen.used ? seen.explained / (seen.explained + seen.assumed) : 0.0;
  last_persisting_ = (1.0 - gain) * seen.explained / slip - gain;
}

}  // namespace roadfix
