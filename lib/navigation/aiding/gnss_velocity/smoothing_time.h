/// With which time constant has a receiver low-pass filtered its velocities? Posterior probabilities of those that
/// VelocityLag carries, by the innovations of velocities, (N.5.15) of MODEL.md. Before accelerations have shown it, what
/// they differ by is noise of a velocity.
#pragma once

#include "navigation/measurement.h"
#include "navigation/velocity_lag.h"

namespace roadfix::navigation {

class SmoothingTime {
 public:
  SmoothingTime();

  /// Of the filtered velocity, over the time constants.
  struct Expected {
    Eigen::Vector3d lag = Eigen::Vector3d::Zero();     ///< m/s
    Eigen::Vector3d rate = Eigen::Vector3d::Zero();    ///< m/s2
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();  ///< (m/s)^2, of the lag
  };
  [[nodiscard]] Expected expected(const VelocityLag& lag, const Eigen::Vector3d& acceleration) const;

  /// An accepted velocity whose innovation was found with expected(lag).lag taken out.
  void learn(const AidingRecord& velocity, const VelocityLag& lag);
  [[nodiscard]] double probability(int k) const { return probability_(k); }

  template <class Archive>
  void serialise(Archive& a) {
    a(probability_);
  }

 private:
  Eigen::Matrix<double, VelocityLag::kCount, 1> probability_;
};

}  // namespace roadfix::navigation
