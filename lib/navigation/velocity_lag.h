/// By how much a velocity that has passed a low pass lags behind the velocity, for some time constants, (N.4.4) of
/// MODEL.md: l' = -l / tau - dv/dt. What the imu measures between two corrections drives it.
#pragma once

#include <Eigen/Dense>
#include <array>

namespace roadfix::navigation {

class VelocityLag {
 public:
  /// s; the first is no low pass. In factors of two: between two of them a lag is a third off at most.
  static constexpr std::array kTimes = {0.0, 0.125, 0.25, 0.5, 1.0, 2.0};
  static constexpr int kCount = static_cast<int>(kTimes.size());

  /// The velocity has changed by dv in dt s.
  void advance(const Eigen::Vector3d& dv, double dt) {
    for (int k = 1; k < kCount; ++k) {
      const double tau = time(k);  // backward Euler
      lag_.col(k) = tau / (tau + dt) * (lag_.col(k) - dv);
    }
  }
  [[nodiscard]] static double time(int k) { return kTimes[static_cast<size_t>(k)]; }
  /// m/s, level axes.
  [[nodiscard]] auto lag(int k) const { return lag_.col(k); }
  /// m/s2, rate of change of the filtered velocity where the velocity itself changes by `acceleration`.
  [[nodiscard]] Eigen::Vector3d rate(int k, const Eigen::Vector3d& acceleration) const {
    return k == 0 ? acceleration : Eigen::Vector3d(-1.0 / time(k) * lag_.col(k));
  }

  template <class Archive>
  void serialise(Archive& a) {
    a(lag_);
  }

 private:
  Eigen::Matrix<double, 3, kCount> lag_ = Eigen::Matrix<double, 3, kCount>::Zero();
};

}  // namespace roadfix::navigation
