#include "fusion/imm.h"

#include <algorithm>
#include <cmath>

namespace roadfix {

using namespace fusion;

namespace {

/// Moments of a mixture. Differences are taken from the first component, so that equal components give their own bits.
FusionEstimate mixture(const Imm& imm, const Eigen::Vector2d& weight) {
  const FusionEstimate& a = imm.modes[0].estimate;
  const FusionEstimate& b = imm.modes[1].estimate;
  const Vector d = difference(b.x, a.x);
  FusionEstimate m;
  m.x = plus(a.x, weight(1) * d);
  m.P = a.P + weight(1) * (b.P - a.P) + (weight(0) * weight(1)) * d * d.transpose();
  return m;
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
  std::array<FusionEstimate, kModes> mixed;
  for (int j = 0; j < kModes; ++j) {
    // P(was i | is j); a mode that cannot be reached keeps its own estimate.
    Eigen::Vector2d weight = Eigen::Vector2d::Unit(j);
    if (predicted(j) > 0.0) weight = transition.col(j).cwiseProduct(imm.probability) / predicted(j);
    mixed[static_cast<std::size_t>(j)] = mixture(imm, weight);
  }
  for (std::size_t j = 0; j < kModes; ++j) {
    imm.modes[j].estimate = mixed[j];
    imm.modes[j].log_likelihood = 0.0;
  }
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

FusionEstimate combine(const Imm& imm) { return mixture(imm, imm.probability); }

}  // namespace roadfix
