/// Figures that describe a set of values: mean, root mean square, quantiles.
#pragma once

#include <vector>

namespace roadfix {

/// Of errors: mean and rms of the values as they are (signed where they are), quantiles and max of their magnitudes.
struct Summary {
  int count = 0;
  double mean = 0.0;
  double rms = 0.0;
  double median = 0.0;  ///< of |value|
  double p95 = 0.0;     ///< of |value|
  double max = 0.0;     ///< of |value|
};

Summary summarise(const std::vector<double>& values);

/// The quantile in [0, 1] with linear interpolation between order statistics (Hyndman, Fan 1996, type 7, as numpy's
/// default); zero for an empty set.
double quantile(std::vector<double> values, double probability);
double median(std::vector<double> values);

double mean(const std::vector<double>& values);
double root_mean_square(const std::vector<double>& values);

/// Collects values one by one and answers at any time; keeps them all, so that quantiles are exact.
class RunningSummary {
 public:
  void add(double value) { values_.push_back(value); }
  [[nodiscard]] const std::vector<double>& values() const { return values_; }
  [[nodiscard]] Summary summary() const { return summarise(values_); }

 private:
  std::vector<double> values_;
};

/// Quantile of a stream in constant memory (Jain, Chlamtac, The P2 algorithm, CACM 28, 1985). For processes that run
/// for days; the result depends on the order of the values.
class StreamingQuantile {
 public:
  explicit StreamingQuantile(double probability);
  void add(double value);
  [[nodiscard]] double value() const;
  [[nodiscard]] long count() const { return count_; }

 private:
  [[nodiscard]] double parabolic(int i, double sign) const;

  double probability_;
  long count_ = 0;
  double height_[5] = {};    ///< marker heights
  double position_[5] = {};  ///< marker positions, counted from 1
  double desired_[5] = {};   ///< where they should be
  double increment_[5] = {};
};

}  // namespace roadfix
