/// Has the IMU changed? A shock of power or temperature moves its biases by more than they ever wander, and a filter
/// that is sure of them refuses every fix that shows it. Fixes that agree with the receiver's own velocity and the
/// wheels, and not with the filter, are right.
#pragma once

#include <cmath>
#include <cstdint>

#include "gnss_ins/pending.h"

namespace roadfix {

class ImuDoubt {
 public:
  /// m/s by which the wheels are faster than the filter.
  void wheels(int64_t t_us, double excess) {
    wheels_us_ = t_us;
    wheels_excess_ = excess;
  }

  /// The receiver's velocity likewise, and its covariance; along: the vehicle's axis; m2/s2, of one wheel speed.
  void receiver(int64_t t_us, const Eigen::Vector3d& excess, const Eigen::Matrix3d& cov, const Eigen::Vector3d& along,
                double wheel_variance, double sigmas) {
    const double variance = cov.trace();
    const bool follows = seconds_between(velocity_us_, t_us) < kShown;
    if (follows && (excess - velocity_excess_).squaredNorm() > sigmas * sigmas * (variance + velocity_variance_))
      jumped_us_ = t_us;
    velocity_us_ = t_us;
    velocity_excess_ = excess;
    velocity_variance_ = variance;
    if (wheels_us_ == 0 || std::abs(seconds_between(wheels_us_, t_us)) > kTogether) return;
    apart_ += along.dot(excess) - wheels_excess_;
    variance_ += along.dot(cov * along) + wheel_variance;
    ++compared_;
  }

  /// A position was taken.
  void agreed(const Pending& p) {
    agreed_us_ = p.t_us;
    contradiction_ = p.contradiction;
    refused_ = compared_ = 0;
    apart_ = variance_ = 0.0;
  }

  /// A position was refused that was off by so much: is it the IMU, at this many sigmas, (M.46)?
  [[nodiscard]] bool refused(const Pending& p, const Eigen::Vector3d& off, double sigmas) {
    if (refused_++ == 0) smoothly_ = jumped_us_ == 0 || seconds_between(jumped_us_, p.t_us) > kShown;
    const bool told = p.told_since_us != 0 && p.told_since_us <= agreed_us_;
    if (refused_ < kFixes || !smoothly_ || !told) return false;
    if ((p.contradiction - contradiction_).norm() > kContradiction * off.norm()) return false;
    return compared_ == 0 || std::abs(apart_) < sigmas * std::sqrt(variance_);
  }
  /// s since a position agreed.
  [[nodiscard]] double since(int64_t t_us) const { return seconds_between(agreed_us_, t_us); }

  template <class Archive>
  void serialise(Archive& a) {
    a(velocity_us_, velocity_excess_, velocity_variance_, jumped_us_, wheels_us_, wheels_excess_, apart_, variance_,
      compared_, agreed_us_, contradiction_, refused_, smoothly_);
  }

 private:
  static constexpr double kShown = 3.0;          // s after which a velocity that jumped has shown in the positions
  static constexpr double kTogether = 0.3;       // s between a velocity and the wheel speed beside it
  static constexpr double kContradiction = 0.5;  // of what a position is off by; of a jump or a drag-off it is all
  static constexpr int kFixes = 3;               // a single bad one leaves no trace

  int64_t velocity_us_ = 0, jumped_us_ = 0;
  Eigen::Vector3d velocity_excess_ = Eigen::Vector3d::Zero();
  double velocity_variance_ = 0.0;
  int64_t wheels_us_ = 0;
  double wheels_excess_ = 0.0;
  double apart_ = 0.0, variance_ = 0.0;  // sums since a position agreed
  int compared_ = 0;
  int64_t agreed_us_ = 0;
  Eigen::Vector3d contradiction_ = Eigen::Vector3d::Zero();  // as that position had it
  int refused_ = 0;                                          // since then
  bool smoothly_ = false;  // the receiver's velocity had not jumped when its positions began to be refused
};

}  // namespace roadfix
