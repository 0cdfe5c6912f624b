/// Wheel speeds that the gate refuses one after another, all by about the same share: another scale, (M.51).
#pragma once

#include <cmath>
#include <cstdint>
#include <optional>

#include "samples/samples.h"

namespace roadfix {

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
