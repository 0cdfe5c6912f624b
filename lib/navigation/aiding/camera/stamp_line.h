/// Puts late stamps right. A camera with its own clock takes pictures evenly; what delays a stamp is the computer, so
/// it comes late and never early, (N.6.13). How late stamps come is learnt from them: what is known before is a bound as
/// often as a measurement.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace roadfix::navigation {

class StampLine {
 public:
  /// A rate or jitter of zero leaves stamps as they are.
  StampLine(double rate_hz, double jitter_s)
      : period_us_(rate_hz > 0.0 && jitter_s > 0.0 ? 1e6 / rate_hz : 0.0),
        known_us_(1e6 * jitter_s),
        late_square_(kKnown * known_us_ * known_us_) {}

  /// The moment of the next picture, by its stamp.
  int64_t on_time(int64_t stamp_us) {
    const auto waited = static_cast<double>(stamp_us - last_us_);
    // Late by up to three quarters of a period is late; later is the next picture.
    const double steps = period_us_ > 0.0 ? std::max(1.0, std::floor(waited / period_us_ + kEarly)) : 0.0;
    if (last_us_ == 0 || period_us_ <= 0.0 || steps > kLostSteps) return last_us_ = stamp_us;
    const double late_us = waited - steps * period_us_;
    count_ = kMemory * count_ + 1.0;
    late_sum_ = kMemory * late_sum_ + late_us;
    late_square_ = kMemory * late_square_ + late_us * late_us;
    last_us_ += std::llround(steps * period_us_ + (late_us < 0.0 ? late_us : kGain * late_us));
    return last_us_;
  }
  [[nodiscard]] int64_t last_us() const { return last_us_; }
  /// Standard deviation of what is left on the line, s; without a line that of the stamps.
  [[nodiscard]] double jitter() const {
    if (period_us_ <= 0.0) return 1e-6 * known_us_;
    const double mean = late_sum_ / count_;
    return 1e-6 * kLeft * std::sqrt(std::max(0.0, late_square_ / count_ - mean * mean));
  }

  template <class Archive>
  void serialise(Archive& a) {
    a(last_us_, count_, late_sum_, late_square_);
  }

 private:
  static constexpr double kGain = 0.02;       ///< of a late stamp; follows clocks that drift by 1e-3
  static constexpr double kEarly = 0.25;      ///< of a period, by which a stamp may be before the line
  static constexpr double kLostSteps = 20.0;  ///< pictures lost before the line begins anew
  static constexpr double kLeft = 0.1;        ///< of the jitter, on the line
  static constexpr double kKnown = 4.0;       ///< pictures that what is known before counts for
  static constexpr double kMemory = 0.99;     ///< per picture

  double period_us_;
  double known_us_;
  int64_t last_us_ = 0;
  double count_ = kKnown, late_sum_ = 0.0, late_square_;  ///< of what stamps are late by, fading
};

}  // namespace roadfix::navigation
