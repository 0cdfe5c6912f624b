/// Central differences of a function on vectors; on a manifold, hand in h(d) = local(f(x), f(retract(x, d))).
#pragma once

#include <Eigen/Dense>

namespace roadfix::test {

/// d h / d d at d = 0, h from Cols to Rows reals. The default step balances rounding and truncation for values of size
/// one.
template <int Rows, int Cols, typename Function>
Eigen::Matrix<double, Rows, Cols> numerical_jacobian(const Function& h, double step = 1e-5) {
  Eigen::Matrix<double, Rows, Cols> J;
  for (int i = 0; i < Cols; ++i) {
    Eigen::Matrix<double, Cols, 1> d = Eigen::Matrix<double, Cols, 1>::Zero();
    d(i) = step;
    const Eigen::Matrix<double, Rows, 1> plus = h(d);
    d(i) = -step;
    const Eigen::Matrix<double, Rows, 1> minus = h(d);
    J.col(i) = (plus - minus) / (2.0 * step);
  }
  return J;
}

}  // namespace roadfix::test
