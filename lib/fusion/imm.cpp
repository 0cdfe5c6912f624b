#include "fusion/imm.h"

#include <algorithm>
#include <cmath>

namespace roadfix {

using namespace fusion;

namespace {

/// Moments of the mixture of a and b = a + d, weight w on b. Differences are taken from the first component, so that
/// equal components give their own bits. `P` may be that of a or b.
void mixed_covariance(const Matrix& P_a, const Matrix& P_b, const Vector& d, double w, Matrix& P) {
  const double spread = (1.0 - w) * w;
  for (int j = 0; j < kSize; ++j) {
    P.col(j) = (P_a.col(j) + w * (P_b.col(j) - P_a.col(j)) + (spread * d(j)) * d).eval();
  }
}

}  // namespace

Eigen::Matrix2d mode_transition(double dt, const Eigen::Vector2d& mean_duration) {
  const double leave0 = 1.0 - std::exp(-dt / mean_duration(0));
  const double leave1 = 1.0 - std::exp(-dt / mean_duration(1));
  Eigen::Matrix2d T;
  T << 1.0 - leave0, leave0, leave1, 1.0 - leave1;
  return T;
}

void mix(Imm& imm, const Eigen::Matrix2d& transition) {
  const Eigen::Vector2d predicted = transition.transpose() * imm.probability;
  FusionEstimate& a = imm.modes[0].estimate;
  FusionEstimate& b = imm.modes[1].estimate;
  const Vector d = difference(b.x, a.x);
  // P(was the second | is j); a mode that cannot be reached keeps its own estimate.
  const auto from_b = [&](int j) {
    return predicted(j) > 0.0 ? transition(1, j) * imm.probability(1) / predicted(j) : static_cast<double>(j);
  };
  const double w_a = from_b(0), w_b = from_b(1);
  Matrix P;
  mixed_covariance(a.P, b.P, d, w_a, P);
  mixed_covariance(a.P, b.P, d, w_b, b.P);
  b.x = plus(a.x, w_b * d);
  a.P = P;
  a.x = plus(a.x, w_a * d);
  for (Mode& mode : imm.modes) mode.log_likelihood = 0.0;
  imm.probability = predicted;
}

void predict(Imm& imm, const MotionNoise& noise, double dt) {
  for (Mode& mode : imm.modes) move(mode.estimate, mode.kind, noise, dt);
}

void reweigh(Imm& imm) {
  const double l0 = imm.modes[0].log_likelihood, l1 = imm.modes[1].log_likelihood;
  const double largest = std::max(l0, l1);
  if (!std::isfinite(largest)) return;
  const Eigen::Vector2d weighted(imm.probability(0) * std::exp(l0 - largest),
                                 imm.probability(1) * std::exp(l1 - largest));
  const double sum = weighted.sum();
  if (sum > 0.0) imm.probability = weighted / sum;
}

FusionEstimate combine(const Imm& imm) {
  const FusionEstimate& a = imm.modes[0].estimate;
  const FusionEstimate& b = imm.modes[1].estimate;
  const Vector d = difference(b.x, a.x);
  FusionEstimate m;
  m.x = plus(a.x, imm.probability(1) * d);
  mixed_covariance(a.P, b.P, d, imm.probability(1), m.P);
  return m;
}

PlanarMixture combine_planar(const Imm& imm) {
  const FusionEstimate& a = imm.modes[0].estimate;
  const FusionEstimate& b = imm.modes[1].estimate;
  const double w = imm.probability(1);
  const Vector d = difference(b.x, a.x);
  PlanarMixture m;
  m.x = plus(a.x, w * d);
  const Eigen::Matrix3d P_a = a.P.block<3, 3>(kPos, kPos), P_b = b.P.block<3, 3>(kPos, kPos);
  const Eigen::Vector3d spread = d.segment<3>(kPos);
  m.P = P_a + w * (P_b - P_a) + ((1.0 - w) * w) * (spread * spread.transpose());
  return m;
}

}  // namespace roadfix
