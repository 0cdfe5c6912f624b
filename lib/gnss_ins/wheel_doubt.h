/// Do the wheels tell the speed that the receiver tells? A tyre that slips by a few hundredths, uphill or on snow, is
/// too little for the gate of one speed, and ten a second outweigh the fixes that would show it.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>

#include "samples/samples.h"

namespace roadfix {

class WheelDoubt {
 public:
  /// m/s by which the wheels, at their estimated scale, are faster than the filter.
  void wheels(double excess) {
    excess_ += excess;
    ++count_;
  }

  /// The receiver's velocity, along the vehicle.
  struct Speed {
    int64_t t_us = 0;
    double value = 0.0;           ///< m/s, as the filter has it
    double excess = 0.0;          ///< m/s by which the receiver is faster than that
    double variance = 0.0;        ///< m2/s2
    double wheel_variance = 0.0;  ///< m2/s2, of one wheel speed
    double scale_variance = 0.0;  ///< of the wheels' scale
    /// m, by which the receiver's positions have gone further along the vehicle since the last one than its velocities.
    double contradiction = 0.0;
  };
  struct Doubt {
    double share = 0.0;  ///< by which the wheels have read too little; less than zero: too much
    double way = 0.0;    ///< m, on which they did so
  };
  /// Nothing while chance, at this many sigmas, explains what they differ by, or the receiver contradicts itself, as
  /// one that repeats itself does, (M.45).
  std::optional<Doubt> receiver(const Speed& s, double sigmas) {
    const double dt = seconds_between(last_us_, s.t_us);
    last_us_ = s.t_us;
    const int count = count_;
    const double wheels = count > 0 ? excess_ / count : 0.0;
    excess_ = 0.0;
    count_ = 0;
    if (count == 0 || dt > kLongest || std::abs(s.value) < kLeastSpeed) return std::nullopt;
    const double weight = s.value / (s.variance + s.wheel_variance / count);
    told_[0].information += s.value * weight;
    told_[0].sum += (s.excess - wheels) * weight;
    told_[0].way += std::abs(s.value) * dt;
    told_[0].contradiction += s.contradiction;
    time_ += dt;
    if (time_ < kSpan) return std::nullopt;
    const bool slips = std::abs(told_[0].sum) < kMostSlip * told_[0].information;
    const std::optional<Doubt> doubt = slips ? most_likely(s.scale_variance, sigmas) : std::nullopt;
    if (doubt || !slips) told_ = {};
    std::copy_backward(told_.begin(), told_.end() - 1, told_.end());
    told_[0] = {};
    time_ = 0.0;
    return doubt;
  }

  template <class Archive>
  void serialise(Archive& a) {
    a(excess_, count_, last_us_, time_);
    for (Told& t : told_) a(t.information, t.sum, t.way, t.contradiction);
  }

 private:
  static constexpr double kSpan = 1.0;        // s, of one comparison
  static constexpr double kLongest = 1.5;     // s, between two velocities
  static constexpr double kLeastSpeed = 2.0;  // m/s
  static constexpr double kMostSlip = 0.1;    // more is for the gate of one speed, or a receiver that stands still
  static constexpr double kFixesApart = 0.1;  // m, what RTK-fixed positions scatter by

  /// What one comparison tells of the share.
  struct Told {
    double information = 0.0;
    double sum = 0.0;            // share times information
    double way = 0.0;            // m
    double contradiction = 0.0;  // m
  };

  /// Over the last one, two, ... comparisons: since when the wheels tell wrong is not known.
  [[nodiscard]] std::optional<Doubt> most_likely(double scale_variance, double sigmas) const {
    Told all;
    for (const Told& t : told_) {
      all.information += t.information;
      all.sum += t.sum;
      all.way += t.way;
      all.contradiction += t.contradiction;
      if (!(all.information > 0.0)) break;
      const double share = all.sum / all.information;
      if (std::abs(all.contradiction) > kFixesApart + 0.5 * std::abs(share) * all.way) continue;
      if (share * share > sigmas * sigmas * (1.0 / all.information + scale_variance)) return Doubt{share, all.way};
    }
    return std::nullopt;
  }

  double excess_ = 0.0;
  int count_ = 0;
  int64_t last_us_ = 0;
  double time_ = 0.0;
  std::array<Told, 30> told_{};  // newest first
};

/// Wheel speeds that the gate refuses one after another, all by about the same share: another scale, (M.51).
class RefusedWheels {
 public:
  void accepted() { count_ = 0; }

  /// The share by which they read too much, once there are enough of them. Both in m/s.
  std::optional<double> refused(int64_t t_us, double excess, double speed) {
    if (std::abs(speed) < kLeastSpeed) return std::nullopt;
    const double share = excess / speed;
    if (count_ == 0 || share * mean_ <= 0.0 || std::abs(share - mean_) > kAlike * std::abs(mean_)) {
      since_us_ = t_us;
      count_ = 0;
      mean_ = 0.0;
    }
    mean_ += (share - mean_) / ++count_;
    const double lasted = seconds_between(since_us_, t_us), size = std::abs(mean_);
    if (count_ < kFew || size > kMost || lasted < (size < kMostSlip ? kShort : kLong)) return std::nullopt;
    count_ = 0;
    return mean_;
  }

  template <class Archive>
  void serialise(Archive& a) {
    a(since_us_, count_, mean_);
  }

 private:
  static constexpr double kLeastSpeed = 2.0;  // m/s
  static constexpr double kAlike = 0.5;
  static constexpr double kMostSlip = 0.1;  // more is a wheel that spins or is braked
  static constexpr double kMost = 0.5;
  static constexpr double kShort = 0.45, kLong = 5.0;  // s
  static constexpr int kFew = 5;

  int64_t since_us_ = 0;
  int count_ = 0;
  double mean_ = 0.0;
};

}  // namespace roadfix
