/// How well this car holds its track: the noise of the no-sideslip constraint, learnt while GNSS shows the truth.
///
/// Its variance is that of a straight road and a part that grows with the square of the acceleration (tyre slip,
/// springs), both learnt (M.30), and inflated by the correlation of successive slips, because a filter that takes
/// correlated residuals for independent ones is overconfident (M.31).
#pragma once

#include "gnss_ins/config.h"
#include "gnss_ins/measurement.h"

namespace roadfix {

/// A residual of the constraint, as the filter met it.
struct SideslipResidual {
  double value = 0.0;      ///< m/s
  double explained = 0.0;  ///< its variance as the filter's own uncertainty alone explains it
  double assumed = 0.0;    ///< the variance that the constraint was used with
  bool used = false;       ///< it passed the gate
};

/// A variance from squares that have it, times a known scale, beside other noise.
class LearntVariance {
 public:
  LearntVariance(double start_std, double least_std, double prior_count)
      : value_(start_std * start_std), least_(least_std * least_std), count_(prior_count) {}

  /// `seen` is a square of mean value() * scale + noise; `independent` of it is news.
  void learn(double seen, double noise, double scale, double independent, double memory);
  [[nodiscard]] double value() const { return value_; }
  /// With `confidence` of its own standard deviations on top.
  [[nodiscard]] double careful(double confidence) const;

  template <class Archive>
  void serialise(Archive& a) {
    a(value_, count_);
  }

 private:
  double value_, least_;
  double count_;  ///< squares of nothing else that would tell as much
};

class SideslipNoise {
 public:
  /// start_std: m/s, of a straight road before anything is learnt; it and the config's slope count for `prior_count`.
  SideslipNoise(const SideslipConfig& config, double start_std, double prior_count);

  /// m/s, to use at this acceleration (m/s2: lateral, or horizontal for the vertical axis).
  [[nodiscard]] double sigma(double acceleration) const;

  void learn(const SideslipResidual& seen, double acceleration);

  template <class Archive>
  void serialise(Archive& a) {
    straight_.serialise(a);
    slope_.serialise(a);
    a(seen_, product_, persisting_, last_, last_persisting_);
  }

 private:
  /// Of successive slips: the product of successive residuals less what the filter's own error leaves in it.
  [[nodiscard]] double correlation() const;

  SideslipConfig config_;
  LearntVariance straight_;  ///< (m/s)^2
  LearntVariance slope_;     ///< of (m/s) / (m/s2), s^2
  double seen_ = 1.0;
  double product_ = 0.0;     ///< mean product of successive residuals, in sigmas of the slip
  double persisting_ = 0.0;  ///< mean of what the filter's error alone puts into that product
  double last_ = 0.0, last_persisting_ = 0.0;
};

}  // namespace roadfix
