/// Noise of wheel speeds, with the rounding of a bus that carries them in steps (MODEL.md (W.6.4)).
#pragma once

namespace roadfix {

class WheelSpeedNoise {
 public:
  /// `sigma`: m/s, white noise of one sample.
  explicit WheelSpeedNoise(double sigma) : sigma_(sigma) {}

  /// Estimates the step from successive speeds, m/s, as received.
  void observe(double speed);
  /// Standard deviation of one sample alone, m/s.
  [[nodiscard]] double of_one() const;
  /// Standard deviation of one of many samples dt_s apart, m/s.
  [[nodiscard]] double of_many(double dt_s) const;

  template <class Archive>
  void serialise(Archive& a) {
    a(last_speed_, smallest_change_, num_changes_);
  }

 private:
  double sigma_;
  double last_speed_ = 0.0;       ///< m/s
  double smallest_change_ = 0.0;  ///< m/s, smallest non-zero difference of successive speeds
  int num_changes_ = 0;           ///< saturated
};

}  // namespace roadfix
