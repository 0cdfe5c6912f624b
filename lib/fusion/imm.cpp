#include "fusion/imm.h"

#include <algorithm>
#include <cmath>

#include "geometry/so3.h"

namespace roadfix {

using namespace fusion;

namespace {

/// Of the mixture of a and b = a + d, weight w on b, what the difference d adds to the covariance.
double spread(double w) { return (1.0 - w) * w; }

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
  // Differences are taken from the first mode, so that equal modes keep their bits.
  for (int j = 0; j < kStates; ++j) {
    const Vector first = a.P.col(j), apart = b.P.col(j) - first;
    a.P.col(j) = first + w_a * apart + (spread(w_a) * d(j)) * d;
    b.P.col(j) = first + w_b * apart + (spread(w_b) * d(j)) * d;
  }
  b.x = plus(a.x, w_b * d);
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

void combine(const Imm& imm, FusionEstimate& m) {
  const FusionEstimate& a = imm.modes[0].estimate;
  const FusionEstimate& b = imm.modes[1].estimate;
  const Vector d = difference(b.x, a.x);
  const double w = imm.probability(1);
  m.x = plus(a.x, w * d);
  for (int j = 0; j < kStates; ++j) m.P.col(j) = a.P.col(j) + w * (b.P.col(j) - a.P.col(j)) + (spread(w) * d(j)) * d;
}

PlanarMixture combine_planar(const Imm& imm) {
  const FusionEstimate& a = imm.modes[0].estimate;
  const FusionEstimate& b = imm.modes[1].estimate;
  const double w = imm.probability(1);
  const Planar d = difference_of(b.x.segment<3>(kPos), a.x.segment<3>(kPos));
  const Eigen::Matrix3d P_a = a.P.block<3, 3>(kPos, kPos), P_b = b.P.block<3, 3>(kPos, kPos);
  PlanarMixture m;
  m.planar.pose = a.x.segment<3>(kPos) + w * d;
  m.planar.pose.z() = wrap_angle(m.planar.pose.z());
  m.planar.P = P_a + w * (P_b - P_a) + spread(w) * (d * d.transpose());
  m.speed = a.x(kSpeed) + w * (b.x(kSpeed) - a.x(kSpeed));
  return m;
}

}  // namespace roadfix
