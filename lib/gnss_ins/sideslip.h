/// How well this car holds its track: the noise of the no-sideslip constraint, learnt while GNSS shows the truth.
///
/// A learnt sigma must not be trusted where it was not learnt, so it is relative: to a growth with the lateral
/// acceleration (tyre slip), and inflated by the correlation of successive residuals, because a filter that takes
/// correlated residuals for independent ones is overconfident (M.30), (M.31).
#pragma once

#include "gnss_ins/config.h"
#include "gnss_ins/measurement.h"

namespace roadfix {

class SideslipNoise {
 public:
  explicit SideslipNoise(const SideslipConfig& config);

  /// m/s, to use at this lateral acceleration.
  [[nodiscard]] double sigma(double lateral_acceleration) const;

  /// A residual with its variance as the filter's own uncertainty alone explains it.
  void learn(double residual, double predicted_variance, double lateral_acceleration);

  template <class Archive>
  void serialise(Archive& a) {
    a(count_, variance_, explained_, square_, product_, last_);
  }

 private:
  [[nodiscard]] double growth(double lateral_acceleration) const;

  SideslipConfig config_;
  double count_;
  double variance_;         ///< of the residual beyond the filter's uncertainty, at rest
  double explained_ = 0.0;  ///< mean variance of the residual that the filter's own uncertainty explains
  double square_ = 0.0;     ///< mean square of the residual
  double product_ = 0.0;    ///< mean product of successive residuals
  double last_ = 0.0;
};

}  // namespace roadfix
