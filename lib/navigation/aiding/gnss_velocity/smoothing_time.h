/// With which time constant has a receiver low-pass filtered its velocities? Posterior probabilities of those that
/// VelocityLag carries, by the innovations of velocities, (N.5.14) of MODEL.md. Before accelerations have shown it, what
/// they differ by is noise of a velocity. Where the latency is unknown too, each time constant has its own, (N.5.15).
#pragma once

#include "navigation/measurement.h"
#include "navigation/velocity_lag.h"

namespace roadfix::navigation {

class SmoothingTime {
 public:
  /// `latency_std`: s, of the velocities' latency, before anything is known.
  explicit SmoothingTime(double latency_std);

  /// Of the filtered velocity, over the time constants.
  struct Expected {
    Eigen::Vector3d lag = Eigen::Vector3d::Zero();     ///< m/s
    Eigen::Vector3d rate = Eigen::Vector3d::Zero();    ///< m/s2
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();  ///< (m/s)^2, of the lag
  };
  /// `acceleration_variance`: (m/s2)^2, of what the imu says by tilt and biases, which a lag has T times.
  [[nodiscard]] Expected expected(const VelocityLag& lag, const Eigen::Vector3d& acceleration,
                                  const Eigen::Vector3d& acceleration_variance) const;

  /// An accepted velocity whose innovation was found with expected(lag).lag taken out, at this latency (s, beyond that of
  /// the receiver's positions, which its clock has too). Returns by how much the latency has to change for what is
  /// believed of the time constant now.
  [[nodiscard]] double learn(const AidingRecord& velocity, const VelocityLag& lag, const Eigen::Vector3d& acceleration,
                             const Eigen::Vector3d& acceleration_variance, double latency);
  [[nodiscard]] double probability(int k) const { return probability_(k); }

  template <class Archive>
  void serialise(Archive& a) {
    a(probability_, square_, by_latency_, information_);
  }

 private:
  using Each = Eigen::Matrix<double, VelocityLag::kCount, 1>;
  /// s, by time constant.
  [[nodiscard]] Each latency() const;

  double latency_information_;  ///< 1/s2, of the prior; infinite where the latency is known
  Each probability_, prior_;
  /// Sums over velocities of y' W y, a' W y and a' W a, with y the innovation without latency.
  Each square_ = Each::Zero(), by_latency_ = Each::Zero(), information_ = Each::Zero();
};

}  // namespace roadfix::navigation
