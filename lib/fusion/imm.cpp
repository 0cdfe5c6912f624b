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
  with_size(a, [&](auto rows, auto columns) {
    const Register* apart_x = registers(d.data());
    for (int j = 0; j < columns; ++j) {
      Register *in_a = column(a.P, j), *in_b = column(b.P, j);
      const double of_a = spread(w_a) * d(j), of_b = spread(w_b) * d(j);
      each_register<rows>([&](int i) {
        const Register first = in_a[i], apart = in_b[i] - first;
        in_a[i] = first + w_a * apart + of_a * apart_x[i];
        in_b[i] = first + w_b * apart + of_b * apart_x[i];
      });
    }
  });
  b.x = plus(a.x, w_b * d);
  a.x = plus(a.x, w_a * d);
  for (Mode& mode : imm.modes) mode.log_likelihood = 0.0;
  imm.probability = predicted;
}

void predict(Imm& imm, const MotionNoise& noise, double dt, PosesBefore* before) {
  for (std::size_t i = 0; i < kModes; ++i) {
    Mode& mode = imm.modes[i];
    move(mode.estimate, mode.kind, noise, dt, before != nullptr ? &(*before)[i] : nullptr);
  }
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
  set_cloned(m, a.cloned);
  m.x = plus(a.x, w * d);
  with_size(a, [&](auto rows, auto columns) {
    const Register* apart_x = registers(d.data());
    for (int j = 0; j < columns; ++j) {
      const Register *in_a = column(a.P, j), *in_b = column(b.P, j);
      Register* out = column(m.P, j);
      const double of_x = spread(w) * d(j);
      each_register<rows>([&](int i) { out[i] = in_a[i] + w * (in_b[i] - in_a[i]) + of_x * apart_x[i]; });
    }
  });
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

double place_variance(const Imm& imm) { return combined_variance(imm, kPos) + combined_variance(imm, kPos + 1); }

double combined_variance(const Imm& imm, int i) {
  const FusionEstimate& a = imm.modes[0].estimate;
  const FusionEstimate& b = imm.modes[1].estimate;
  const double w = imm.probability(1);
  const double d = b.x(i) - a.x(i);
  return a.P(i, i) + w * (b.P(i, i) - a.P(i, i)) + spread(w) * (d * d);
}

}  // namespace roadfix
