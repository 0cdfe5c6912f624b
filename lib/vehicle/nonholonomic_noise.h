/// Noise of the non-holonomic constraint, one estimator per axis, learnt while GNSS shows the truth, (V.3.1) to (V.3.3)
/// of MODEL.md: the variance on a straight road and a part that grows with the square of the acceleration (tyre slip,
/// springs), inflated by the correlation of successive residuals, because a filter that takes correlated residuals for
/// independent ones is overconfident.
#pragma once

namespace roadfix::vehicle {

struct NonholonomicConfig {
  double lateral_std = 0.1;     ///< m/s, before anything is learnt
  double vertical_std = 0.05;   ///< m/s, likewise: roads of class A to C (ISO 8608) give 0.02 to 0.08
  double slope = 0.03;          ///< s: m/s per m/s2 of acceleration, likewise (rear slip angle at 10 m/s)
  double lateral_prior = 0.2;   ///< residuals that the start counts for: cars differ most there
  double vertical_prior = 4.0;  ///< likewise
  double memory = 400.0;        ///< residuals
  double min_std = 0.001;       ///< m/s, the least that is used
  double max_std = 0.5;         ///< m/s
};

template <class Visitor>
void visit(NonholonomicConfig& c, Visitor& v) {
  v.number("lateral_std_mps", c.lateral_std, 1e-3, 10.0);
  v.number("vertical_std_mps", c.vertical_std, 1e-3, 10.0);
  v.number("slope_s", c.slope, 1e-3, 10.0);
  v.number("lateral_prior", c.lateral_prior, 0.01, 1e6);
  v.number("vertical_prior", c.vertical_prior, 0.01, 1e6);
  v.number("memory", c.memory, 1.0, 1e6);
  v.number("min_std_mps", c.min_std, 1e-4, 10.0);
  v.number("max_std_mps", c.max_std, 1e-3, 10.0);
}

/// A residual of the constraint, as the filter saw it.
struct NonholonomicResidual {
  double value = 0.0;      ///< m/s
  double explained = 0.0;  ///< its variance by the filter's own uncertainty alone
  double assumed = 0.0;    ///< the variance that the constraint was used with
  bool used = false;       ///< it passed the gate
};

/// A variance estimated from squares that contain it, times a known scale, beside other noise.
class LearntVariance {
 public:
  LearntVariance(double start_std, double least_std, double prior_count)
      : value_(start_std * start_std), least_(least_std * least_std), count_(prior_count) {}

  /// `square` has the mean value() * scale + noise; `independent`: its share that is not correlated with the last.
  void learn(double square, double noise, double scale, double independent, double memory);
  [[nodiscard]] double value() const { return value_; }
  /// Mean of what the variance may be: more than value() where few squares tell of it.
  [[nodiscard]] double expected() const;

  template <class Archive>
  void serialise(Archive& a) {
    a(value_, count_);
  }

 private:
  double value_, least_;
  double count_;  ///< squares without other noise that would carry as much information
};

class NonholonomicNoise {
 public:
  enum class Axis { kLateral, kVertical };
  NonholonomicNoise(const NonholonomicConfig& config, Axis axis);

  /// m/s, to use at this acceleration (m/s2: lateral, or horizontal for the vertical axis).
  [[nodiscard]] double sigma(double acceleration) const;
  void learn(const NonholonomicResidual& residual, double acceleration);

  template <class Archive>
  void serialise(Archive& a) {
    straight_.serialise(a);
    slope_.serialise(a);
    a(seen_, product_, persisting_, last_, last_persisting_);
  }

 private:
  /// Of successive slips: the product of successive residuals less what the filter's own error leaves in it.
  [[nodiscard]] double correlation() const;

  NonholonomicConfig config_;
  LearntVariance straight_;  ///< (m/s)^2
  LearntVariance slope_;     ///< of (m/s) / (m/s2), s^2
  double seen_ = 1.0;
  double product_ = 0.0;     ///< mean product of successive residuals, in sigmas of the slip
  double persisting_ = 0.0;  ///< mean of what the filter's error alone puts into that product
  double last_ = 0.0, last_persisting_ = 0.0;
};

}  // namespace roadfix::vehicle
