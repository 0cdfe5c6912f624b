/// The fixes that were rejected since one was used, (N.5.5) of MODEL.md: by how much they are off, which of them agree with
/// each other, and whether that is over lately.
#pragma once

#include <Eigen/Dense>
#include <cstdint>

namespace roadfix::navigation {

class RejectedRun {
 public:
  enum class Next { kFirst, kDiffers, kAgrees };  ///< with those before it; what differs is the first of others

  /// A fix is rejected: `off` (m, level axes) from the filter, of which `noise` (m) may be chance.
  Next add(int64_t t_us, const Eigen::Vector3d& off, double noise);
  /// A fix has been used. `over`: what was rejected was the receiver's error, and is over.
  void end(int64_t t_us, bool over);
  /// Nothing holds against the receiver.
  void clear() { rejected_ = agreeing_ = 0; }

  [[nodiscard]] bool empty() const { return rejected_ == 0; }
  /// When the first was rejected.
  [[nodiscard]] int64_t since_us() const { return since_us_; }
  /// How many of the newest agree with each other.
  [[nodiscard]] int agreeing() const { return agreeing_; }
  /// m, level axes: what the newest is off.
  [[nodiscard]] const Eigen::Vector3d& newest_off() const { return newest_off_; }
  /// A run ended less than this (s) ago.
  [[nodiscard]] bool over_within(int64_t t_us, double seconds) const;

  template <class Archive>
  void serialise(Archive& a) {
    a(rejected_, agreeing_, since_us_, over_us_, first_off_, newest_off_);
  }

 private:
  int rejected_ = 0, agreeing_ = 0;
  int64_t since_us_ = 0, over_us_ = 0;
  Eigen::Vector3d first_off_ = Eigen::Vector3d::Zero();  // of those that agree
  Eigen::Vector3d newest_off_ = Eigen::Vector3d::Zero();
};

}  // namespace roadfix::navigation
