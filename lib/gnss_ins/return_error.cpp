#include "gnss_ins/return_error.h"

#include <algorithm>
#include <cmath>

namespace roadfix {

namespace {

// How long a receiver takes to settle after it has lost all signals is nobody's promise: its loops pull in within a
// second, its smoothing of codes by carriers (Hatch 1982) and its own filter within some. Prior: 0.75 to 8 s at one
// standard deviation, and the rate may change, so that ten seconds later it can be another by a factor of 2.6.
constexpr double kFadeTime = 2.5;    // s
constexpr double kFadeSpread = 1.2;  // of the logarithm
constexpr double kRateWalk = 0.3;    // of the logarithm, 1/sqrt(s)

}  // namespace

void ReturnError::begin(const Eigen::Vector3d& sigma) {
  end();
  active = true;
  value(kRate) = -std::log(kFadeTime);
  cov.diagonal() << sigma.cwiseAbs2(), kFadeSpread * kFadeSpread;
}

double ReturnError::left_of(double dt) const { return std::exp(-dt * std::exp(value(kRate))); }

void ReturnError::move(const Transition& phi, double dt) {
  const double left = left_of(dt);
  Eigen::Matrix<double, kStates, kSize> moved = phi.decay.asDiagonal() * cross;
  moved.topRows<9>() = phi.moved_by.transpose().lazyProduct(cross.topRows<kInertialStates + 3>());
  Matrix F = left * Matrix::Identity();
  F.col(kRate) << -dt * std::exp(value(kRate)) * left * value.head<3>(), 1.0;
  cross = moved.lazyProduct(F.transpose());
  const Matrix half = F.lazyProduct(cov), all = half.lazyProduct(F.transpose());
  cov = 0.5 * (all + all.transpose());
  cov(kRate, kRate) += kRateWalk * kRateWalk * dt;
  value.head<3>() *= left;
}

double ReturnError::size() const {
  const Eigen::Vector3d squares = value.head<3>().cwiseAbs2() + cov.diagonal().head<3>();
  return std::sqrt(std::max(squares.x(), squares.y()));
}

}  // namespace roadfix
