#include "fusion/imm.h"

#include <algorithm>
#include <cmath>

#include "geometry/frames.h"
#include "geometry/so3.h"

namespace roadfix {

using namespace fusion;

namespace {

constexpr double kLongestStep = 0.1;  ///< s, of the motion models

/// Moves `from` by share w of the way to `to`: mean and covariance of the mixture of both, weight w on `to`.
FusionEstimate mixture(const FusionEstimate& from, const FusionEstimate& to, double w) {
  const Vector d = difference(to.x, from.x);
  // Differences are taken from the first one, so that equal modes keep their bits.
  return {plus(from.x, w * d), from.P + w * (to.P - from.P) + (1.0 - w) * w * d * d.transpose()};
}

/// Kalman update of one mode, with the likelihood of the innovation.
template <int M>
void update(Mode& mode, const Eigen::Matrix<double, M, kSize>& H, const Eigen::Matrix<double, M, 1>& innovation,
            const Eigen::Matrix<double, M, M>& R) {
  FusionEstimate& e = mode.estimate;
  const Eigen::Matrix<double, kSize, M> PHt = e.P * H.transpose();
  const Eigen::Matrix<double, M, M> S = H * PHt + R;
  const Eigen::LLT<Eigen::Matrix<double, M, M>> llt(S);
  if (llt.info() != Eigen::Success) return;
  const Eigen::Matrix<double, M, 1> weighted = llt.solve(innovation);
  const Eigen::Matrix<double, M, M> L = llt.matrixL();
  mode.log_likelihood -= 0.5 * (innovation.dot(weighted) + M * std::log(2.0 * kPi)) + L.diagonal().array().log().sum();
  e.x = plus(e.x, PHt * weighted);
  e.P -= PHt * llt.solve(PHt.transpose());
  e.P = (0.5 * (e.P + e.P.transpose())).eval();
}

}  // namespace

Eigen::Matrix2d mode_transition(double dt, const ModeDurations& durations) {
  const double leave0 = 1.0 - std::exp(-dt / durations.straight);
  const double leave1 = 1.0 - std::exp(-dt / durations.turn);
  Eigen::Matrix2d T;
  T << 1.0 - leave0, leave0, leave1, 1.0 - leave1;
  return T;
}

void mix(Imm& imm, const Eigen::Matrix2d& transition) {
  const Eigen::Vector2d predicted = transition.transpose() * imm.probability;
  // P(was the second | is j); a mode that cannot be reached keeps its own estimate.
  const auto from_second = [&](int j) {
    return predicted(j) > 0.0 ? transition(1, j) * imm.probability(1) / predicted(j) : static_cast<double>(j);
  };
  const FusionEstimate a = imm.modes[0].estimate, b = imm.modes[1].estimate;
  imm.modes[0].estimate = mixture(a, b, from_second(0));
  imm.modes[1].estimate = mixture(a, b, from_second(1));
  for (Mode& mode : imm.modes) mode.log_likelihood = 0.0;
  imm.probability = predicted;
}

void predict(Imm& imm, const MotionNoise& noise, double dt) {
  for (Mode& mode : imm.modes) move(mode.estimate, mode.kind, noise, dt);
}

void advance(Imm& imm, const ModeDurations& durations, const MotionNoise& noise, double dt) {
  if (dt <= 0.0) {
    for (Mode& mode : imm.modes) mode.log_likelihood = 0.0;
    return;
  }
  const int steps = std::min(100, 1 + static_cast<int>(dt / kLongestStep));
  const Eigen::Matrix2d transition = mode_transition(dt / steps, durations);
  for (int i = 0; i < steps; ++i) {
    mix(imm, transition);
    predict(imm, noise, dt / steps);
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

FusionEstimate combine(const Imm& imm) {
  return mixture(imm.modes[0].estimate, imm.modes[1].estimate, imm.probability(1));
}

PoseInnovation judge_pose(const FusionEstimate& e, const Planar& pose, const Eigen::Matrix3d& R) {
  const Eigen::Matrix3d S = e.P.block<3, 3>(kPos, kPos) + R;
  PoseInnovation j;
  j.innovation = difference_of(pose, e.x.segment<3>(kPos));
  j.variance = S.diagonal();
  j.nis = j.innovation.dot(S.ldlt().solve(j.innovation));
  return j;
}

void update_pose(Imm& imm, const Planar& pose, const Eigen::Matrix3d& R) {
  Eigen::Matrix<double, 3, kSize> H = Eigen::Matrix<double, 3, kSize>::Zero();
  H.middleCols<3>(kPos).setIdentity();
  for (Mode& mode : imm.modes) update<3>(mode, H, difference_of(pose, mode.estimate.x.segment<3>(kPos)), R);
}

void update_component(Imm& imm, int index, double value, double variance) {
  Eigen::Matrix<double, 1, kSize> H = Eigen::Matrix<double, 1, kSize>::Zero();
  H(0, index) = 1.0;
  for (Mode& mode : imm.modes) {
    double innovation = value - mode.estimate.x(index);
    if (index == kYaw) innovation = wrap_angle(innovation);
    update<1>(mode, H, Eigen::Matrix<double, 1, 1>(innovation), Eigen::Matrix<double, 1, 1>(variance));
  }
}

}  // namespace roadfix
