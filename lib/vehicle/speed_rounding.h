/// Noise of speeds that a bus carries in steps (whole km/h, steps of 0.06 m/s), (V.2.4) of MODEL.md.
#pragma once

#include "samples/samples.h"

namespace roadfix::vehicle {

class SpeedRounding {
 public:
  /// Every sample, as received: the step is found from successive speeds of one wheel.
  void observe(const WheelSample& wheels);
  /// Standard deviation of one speed alone, m/s; zero where speeds come in no steps, or too few have come.
  [[nodiscard]] double of_one() const { return of_many(kCorrelation); }
  /// Of one of many speeds that are used dt_s apart, whose errors are then taken for independent, m/s.
  [[nodiscard]] double of_many(double dt_s) const;

  template <class Archive>
  void serialise(Archive& a) {
    a(last_speed_, smallest_change_, num_changes_);
  }

 private:
  static constexpr double kCorrelation = 1.0;  ///< s, of the rounding error

  double last_speed_ = 0.0;       ///< m/s
  double smallest_change_ = 0.0;  ///< m/s, smallest non-zero difference of successive speeds
  int num_changes_ = 0;           ///< saturated
};

}  // namespace roadfix::vehicle
