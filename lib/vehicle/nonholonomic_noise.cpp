#include "vehicle/nonholonomic_noise.h"

#include <algorithm>
#include <cmath>

namespace roadfix::vehicle {

namespace {

constexpr double kMostRatio = 16.0;  // a residual counts at most as four sigma
constexpr double kMostCorrelation = 0.9;
// So that both can grow again: a tenth of the least that is used, and of what tyres slip at walking pace (3.6 mrad per
// m/s2, driving.h).
constexpr double kLeastLearnt = 1.0e-4;  // m/s
constexpr double kLeastSlope = 2.0e-4;   // s

}  // namespace

void LearntVariance::learn(double square, double noise, double scale, double independent, double memory) {
  // The Fisher information of one square about a variance s in it is 1 / (2 (s + noise)^2).
  const double share = value_ * scale / (value_ * scale + noise);
  const double counts = share * share * independent;
  if (counts <= 0.0) return;
  count_ = std::min(count_ + counts, memory);
  value_ = std::max(value_ + counts / count_ * ((square - noise) / scale - value_), least_);
}

double LearntVariance::expected() const { return value_ * (1.0 + 2.0 / count_); }

NonholonomicNoise::NonholonomicNoise(const NonholonomicConfig& config, Axis axis)
    : config_(config),
      straight_(axis == Axis::kLateral ? config.lateral_std : config.vertical_std, kLeastLearnt,
                axis == Axis::kLateral ? config.lateral_prior : config.vertical_prior),
      slope_(config.slope, kLeastSlope, axis == Axis::kLateral ? config.lateral_prior : config.vertical_prior) {}

double NonholonomicNoise::correlation() const { return std::clamp(product_ - persisting_, 0.0, kMostCorrelation); }

double NonholonomicNoise::sigma(double acceleration) const {
  const double inflation = (1.0 + correlation()) / (1.0 - correlation());
  const double square = acceleration * acceleration;
  const double variance = straight_.expected() + square * slope_.expected();
  return std::clamp(std::sqrt(inflation * variance), config_.min_std, config_.max_std);
}

void NonholonomicNoise::learn(const NonholonomicResidual& residual, double acceleration) {
  const double square = acceleration * acceleration;
  const double straight = straight_.value(), turning = square * slope_.value();
  const double slip = straight + turning;
  const double r2 = std::min(residual.value * residual.value, kMostRatio * (slip + residual.explained));
  const double rho2 = correlation() * correlation();
  const double independent = (1.0 - rho2) / (1.0 + rho2);  // Bartlett 1946
  straight_.learn(r2, turning + residual.explained, 1.0, independent, config_.memory);
  if (square > 0.0) slope_.learn(r2, straight + residual.explained, square, independent, config_.memory);

  const double unit = std::copysign(std::sqrt(r2 / slip), residual.value);
  seen_ = std::min(seen_ + 1.0, config_.memory);
  product_ += (unit * last_ - product_) / seen_;
  persisting_ += (last_persisting_ - persisting_) / seen_;
  last_ = unit;
  // The update takes the share `gain` of its error out of the filter and puts that share of the slip in.
  const double gain = residual.used ? residual.explained / (residual.explained + residual.assumed) : 0.0;
  last_persisting_ = (1.0 - gain) * residual.explained / slip - gain;
}

}  // namespace roadfix::vehicle
