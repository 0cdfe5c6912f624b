/// Random numbers that are the same on every standard library: SplitMix64 (Steele, Lea, Flood, Fast splittable
/// pseudorandom number generators, OOPSLA 2014, figure 16) and the Box-Muller transform. std::normal_distribution is
/// left to the implementation; this is not.
///
/// Each noise source has a stream of its own, so that switching one on does not change another's numbers.
#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <cstdint>
#include <optional>

#include "geometry/frames.h"

namespace roadfix {

class RandomStream {
 public:
  /// Streams of one seed with different numbers, and of different seeds with one number, are independent.
  RandomStream(std::uint64_t seed, std::uint64_t stream) : state_(mix(seed ^ mix(stream + kStreamSalt))) {}

  std::uint64_t bits() { return mix(state_ += kGolden); }
  /// In (0, 1): 53 bits, never an end.
  double uniform() { return (static_cast<double>(bits() >> 11) + 0.5) * 0x1.0p-53; }
  double normal() {
    if (spare_) {
      const double value = *spare_;
      spare_.reset();
      return value;
    }
    const double radius = std::sqrt(-2.0 * std::log(uniform()));
    const double angle = 2.0 * kPi * uniform();
    spare_ = radius * std::sin(angle);
    return radius * std::cos(angle);
  }
  Eigen::Vector3d normal3() {
    const double x = normal();
    const double y = normal();
    const double z = normal();
    return {x, y, z};
  }

 private:
  static constexpr std::uint64_t kGolden = 0x9E3779B97F4A7C15u;      // odd part of 2^64 / golden ratio (same source)
  static constexpr std::uint64_t kStreamSalt = 0xD1B54A32D192ED03u;  // any odd constant
  static std::uint64_t mix(std::uint64_t z) {
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
  }

  std::uint64_t state_;
  std::optional<double> spare_;
};

/// First-order Gauss-Markov process, stationary from its first value: standard deviation sigma, correlation
/// exp(-dt / tau).
class GaussMarkov3 {
 public:
  GaussMarkov3(double sigma, double correlation_s, RandomStream stream)
      : sigma_(sigma), correlation_s_(correlation_s), stream_(stream), value_(sigma * stream_.normal3()) {}

  const Eigen::Vector3d& value() const { return value_; }
  void advance(double dt_s) {
    const double keep = std::exp(-dt_s / correlation_s_);
    value_ = keep * value_ + sigma_ * std::sqrt(1.0 - keep * keep) * stream_.normal3();
  }

 private:
  double sigma_;
  double correlation_s_;
  RandomStream stream_;
  Eigen::Vector3d value_;
};

}  // namespace roadfix
