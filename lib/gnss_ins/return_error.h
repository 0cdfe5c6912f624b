/// The error that a receiver brings back from an outage: it begins metres off, claims decimetres, and fades while its
/// tracking loops and its own filter settle. Three displacements and the logarithm of the rate at which they fade, kept
/// beside the filter's states with all their correlations, from the first fix after an outage until it has faded,
/// (M.37)-(M.39). Without one nothing is computed.
#pragma once

#include "gnss_ins/covariance_step.h"

namespace roadfix {

struct ReturnError {
  static constexpr int kSize = 4;  ///< east, north, up (m), ln of the rate (1/s)
  static constexpr int kRate = 3;
  using Vector = Eigen::Matrix<double, kSize, 1>;
  using Matrix = Eigen::Matrix<double, kSize, kSize>;

  bool active = false;
  Vector value = Vector::Zero();
  Matrix cov = Matrix::Zero();
  Eigen::Matrix<double, kStates, kSize> cross = Eigen::Matrix<double, kStates, kSize>::Zero();  ///< with the filter's

  /// A new one, independent of the filter's errors: nothing is known but how large it may be (m, enu).
  void begin(const Eigen::Vector3d& sigma);
  void end() { *this = ReturnError(); }

  /// m, enu, `dt` seconds after its epoch.
  [[nodiscard]] Eigen::Vector3d after(double dt) const { return left_of(dt) * value.head<3>(); }
  /// Over the step of the filter's own transition.
  void move(const Transition& phi, double dt);
  /// Root mean square of what may be left, m: the largest of the level axes.
  [[nodiscard]] double size() const;

  template <class Archive>
  void serialise(Archive& a) {
    a(active, value, cov, cross);
  }

 private:
  [[nodiscard]] double left_of(double dt) const;
};

}  // namespace roadfix
