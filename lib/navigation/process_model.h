/// What time alone does to the states that no imu moves: how they decay and what noise drives them, (N.2.3) to (N.2.5),
/// (N.2.10), (N.5.1) and (N.5.2) of MODEL.md.
#pragma once

#include "navigation/config.h"
#include "navigation/state.h"

namespace roadfix::navigation {

class ProcessModel {
 public:
  explicit ProcessModel(const NavigationConfig& config) : facts_(config.facts), process_(config.process) {}

  /// Stationary standard deviation (m or m/s, level axes) and correlation time of the receiver's Gauss-Markov errors.
  struct GnssBias {
    Eigen::Vector3d position_std = Eigen::Vector3d::Zero(), velocity_std = Eigen::Vector3d::Zero();
    Eigen::Vector3d position_time = Eigen::Vector3d::Constant(30.0);  ///< s
    double velocity_time = 2.0;                                       ///< s
    Eigen::Vector3d position_walk = Eigen::Vector3d::Zero();          ///< m/sqrt(s), beside it: of a displaced receiver
  };
  [[nodiscard]] GnssBias& gnss_bias() { return gnss_bias_; }
  [[nodiscard]] const GnssBias& gnss_bias() const { return gnss_bias_; }

  /// s, longest step of the covariance.
  [[nodiscard]] double covariance_interval() const { return process_.covariance_interval; }

  /// The means over dt s.
  void decay(State& state, double dt) const;
  /// What a covariance step does to the base block's states that no other moves: decay and added variance.
  struct Diagonal {
    Eigen::Matrix<double, kWithoutCamera, 1> decay, noise;
  };
  /// Over T s; `anchored`: the Earth's rate is known.
  [[nodiscard]] Diagonal over(double T, const State& state, bool anchored) const;
  /// d (what a receiver brought back) over T s by the logarithm of its rate, (N.5.2).
  [[nodiscard]] static Eigen::Vector3d by_return_rate(const Mean& x, double T) {
    return -T * std::exp(x.return_rate) * x.gnss_return;
  }

  template <class Archive>
  void serialise(Archive& a) {
    a(gnss_bias_.position_std, gnss_bias_.velocity_std, gnss_bias_.position_time, gnss_bias_.velocity_time,
      gnss_bias_.position_walk);
  }

 private:
  VehicleFacts facts_;
  ProcessNoise process_;
  GnssBias gnss_bias_;
};

}  // namespace roadfix::navigation
