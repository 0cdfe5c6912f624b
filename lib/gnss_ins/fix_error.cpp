#include "gnss_ins/fix_error.h"

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

void FixError::forget(int first, int size) {
  value.segment(first, size).setZero();
  cross.middleCols(first, size).setZero();
  cov.middleCols(first, size).setZero();
  cov.middleRows(first, size).setZero();
}

void FixError::begin_return(const Eigen::Vector3d& sigma) {
  end_return();
  returning_ = true;
  value(kRate) = -std::log(kFadeTime);
  cov.diagonal().segment<4>(kReturning) << sigma.cwiseAbs2(), kFadeSpread * kFadeSpread;
}

void FixError::end_return() {
  returning_ = false;
  forget(kReturning, 4);
}

void FixError::expect_lasting(FixType type, const LastingShare& like, const Eigen::Vector3d& variance, NavState& x,
                              ErrorMatrix& P) {
  const bool another = !expects(type);
  variance_ = like.share * variance;
  if (another) {
    forget(kLasting, 3);
    cov.diagonal().segment<3>(kLasting) = variance_;
  } else if (like.share != like_.share) {
    rescale_lasting(like.share / like_.share, x, P);
  }
  type_ = type;
  like_ = like;
}

/// As if its prior had been `ratio` times as large in variance: a measurement that says it is nought, or the taking
/// back of one. Exact for an error that has not faded where nothing else tells the place, and in the long run: what is
/// unsure of both grows in proportion. What is taken back makes unsure and moves nothing: from what a prior has held
/// near nought no better mean is found by stretching it.
void FixError::rescale_lasting(double ratio, NavState& x, ErrorMatrix& P) {
  ErrorVector dx = ErrorVector::Zero();
  for (int i = kLasting; i < kSize; ++i) {
    const double variance = cov(i, i);
    if (!(variance > 0.0)) continue;
    const ErrorVector with_state = cross.col(i);
    const Vector with_error = cov.col(i);
    const double more = (ratio - 1.0) / variance, shift = std::min(more, 0.0) * value(i);
    dx += shift * with_state;
    value += shift * with_error;
    // In this order an element and its mirror are rounded alike.
    P += more * (with_state * with_state.transpose()).eval();
    cross += (more * with_state) * with_error.transpose();
    cov += more * (with_error * with_error.transpose()).eval();
  }
  x = retract(x, dx);
}

double FixError::left_of(double dt) const { return std::exp(-dt * std::exp(value(kRate))); }

Eigen::Vector3d FixError::after(double dt) const {
  return left_of(dt) * value.segment<3>(kReturning) + std::exp(-dt * like_.rate) * value.segment<3>(kLasting);
}

void FixError::move(const Transition& phi, double dt) {
  const double left = left_of(dt), lasts = std::exp(-dt * like_.rate);
  Eigen::Matrix<double, kStates, kSize> moved = phi.decay.asDiagonal() * cross;
  moved.topRows<9>() = phi.moved_by.transpose().lazyProduct(cross.topRows<kInertialStates + 3>());
  Vector fade;
  fade << left, left, left, 1.0, lasts, lasts, lasts;
  // F = diag(fade) but for what the rate does to the returning error: it is sparse.
  const Eigen::Vector3d by_rate = -dt * std::exp(value(kRate)) * left * value.segment<3>(kReturning);
  for (int i = 0; i < kSize; ++i) cross.col(i) = fade(i) * moved.col(i);
  cov = fade.asDiagonal() * cov;
  if (returning_) {
    for (int i = 0; i < 3; ++i) {
      cross.col(kReturning + i) += by_rate(i) * moved.col(kRate);
      cov.row(kReturning + i) += by_rate(i) * cov.row(kRate);
    }
  }
  Matrix all = cov * fade.asDiagonal();
  if (returning_)
    for (int i = 0; i < 3; ++i) all.col(kReturning + i) += by_rate(i) * cov.col(kRate);
  cov = 0.5 * (all + all.transpose());
  if (returning_) cov(kRate, kRate) += kRateWalk * kRateWalk * dt;
  cov.diagonal().segment<3>(kLasting) += (1.0 - lasts * lasts) * variance_;
  value.segment<3>(kReturning) *= left;
  value.segment<3>(kLasting) *= lasts;
}

double FixError::return_size() const {
  const Eigen::Vector3d squares = value.segment<3>(kReturning).cwiseAbs2() + cov.diagonal().segment<3>(kReturning);
  return std::sqrt(std::max(squares.x(), squares.y()));
}

}  // namespace roadfix
