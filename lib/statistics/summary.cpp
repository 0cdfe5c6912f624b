#include "statistics/summary.h"

#include <algorithm>
#include <cmath>

namespace roadfix {
namespace {

/// Of sorted values, type 7.
double quantile_of_sorted(const std::vector<double>& sorted, double probability) {
  if (sorted.empty()) return 0.0;
  const double rank = std::clamp(probability, 0.0, 1.0) * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(rank);
  const std::size_t above = std::min(below + 1, sorted.size() - 1);
  const double share = rank - static_cast<double>(below);
  return sorted[below] + share * (sorted[above] - sorted[below]);
}

}  // namespace

double quantile(std::vector<double> values, double probability) {
  std::sort(values.begin(), values.end());
  return quantile_of_sorted(values, probability);
}

double median(std::vector<double> values) { return quantile(std::move(values), 0.5); }

double mean(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double v : values) sum += v;
  return values.empty() ? 0.0 : sum / static_cast<double>(values.size());
}

double root_mean_square(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double v : values) sum += v * v;
  return values.empty() ? 0.0 : std::sqrt(sum / static_cast<double>(values.size()));
}

Summary summarise(const std::vector<double>& values) {
  Summary s;
  s.count = static_cast<int>(values.size());
  if (values.empty()) return s;
  s.mean = mean(values);
  s.rms = root_mean_square(values);
  std::vector<double> magnitudes = values;
  for (double& m : magnitudes) m = std::abs(m);
  std::sort(magnitudes.begin(), magnitudes.end());
  s.median = quantile_of_sorted(magnitudes, 0.5);
  s.p95 = quantile_of_sorted(magnitudes, 0.95);
  s.max = magnitudes.back();
  return s;
}

StreamingQuantile::StreamingQuantile(double probability)
    : probability_(probability),
      position_{1, 2, 3, 4, 5},
      desired_{1, 1 + 2 * probability, 1 + 4 * probability, 3 + 2 * probability, 5},
      increment_{0, probability / 2, probability, (1 + probability) / 2, 1} {}

double StreamingQuantile::parabolic(int i, double sign) const {
  const double left = position_[i] - position_[i - 1];
  const double right = position_[i + 1] - position_[i];
  return height_[i] + sign / (left + right) *
                          ((left + sign) * (height_[i + 1] - height_[i]) / right +
                           (right - sign) * (height_[i] - height_[i - 1]) / left);
}

void StreamingQuantile::add(double value) {
  if (count_ < 5) {
    height_[count_++] = value;
    if (count_ == 5) std::sort(height_, height_ + 5);
    return;
  }
  ++count_;
  height_[0] = std::min(height_[0], value);
  height_[4] = std::max(height_[4], value);
  int cell = 0;
  while (cell < 3 && value >= height_[cell + 1]) ++cell;
  for (int i = cell + 1; i < 5; ++i) position_[i] += 1.0;
  for (int i = 0; i < 5; ++i) desired_[i] += increment_[i];
  for (int i = 1; i < 4; ++i) {
    const double lag = desired_[i] - position_[i];
    const bool forward = lag >= 1.0 && position_[i + 1] - position_[i] > 1.0;
    const bool back = lag <= -1.0 && position_[i - 1] - position_[i] < -1.0;
    if (!forward && !back) continue;
    const int sign = forward ? 1 : -1;
    const double candidate = parabolic(i, sign);
    height_[i] = height_[i - 1] < candidate && candidate < height_[i + 1]
                     ? candidate
                     : height_[i] + sign * (height_[i + sign] - height_[i]) / (position_[i + sign] - position_[i]);
    position_[i] += sign;
  }
}

double StreamingQuantile::value() const {
  if (count_ >= 5) return height_[2];
  return quantile(std::vector<double>(height_, height_ + count_), probability_);
}

}  // namespace roadfix
