#include "navigation/step_detector.h"

#include <algorithm>

namespace roadfix::navigation {

namespace {

constexpr int64_t kApart_us = 1'000'000;  // between two moments
constexpr double kMostOfIt = 0.5;         // of what the innovations have too much, at least, is the step's

}  // namespace

void StepDetector::begin(State& state) {
  if (state.carried().cols() != kColumns) state.carry(kColumns);
  for (int k = 0; k < kColumns; ++k) begin(state, k);
  next_us_ = 0;
  usual_ = 1.0;
  watches_ = true;
}

void StepDetector::begin(State& state, int column) {
  state.carried().col(column).setZero();
  state.carried()(kSteps[static_cast<size_t>(column / kMoments)], column) = 1.0;
  information_(column) = sum_(column) = squares_(column) = 0.0;
}

/// Two moments per octave: of one second the first two take turns, of two seconds the next two, ...
void StepDetector::advance(State& state) {
  const int64_t t_us = state.x.t_us;
  if (!watches_ || t_us < next_us_) return;
  next_us_ = t_us + kApart_us;
  ++turn_;
  for (int octave = 0; octave < kMoments / 2; ++octave) {
    const int period = 1 << octave;
    if (turn_ % period != 0) break;
    for (int h = 0; h < kHypotheses; ++h) begin(state, h * kMoments + 2 * octave + (turn_ / period) % 2);
  }
}

void StepDetector::move(State& state, const Eigen::Matrix<double, 9, kInertialSize>& F,
                        const Eigen::Matrix<double, kWithoutCamera, 1>& decay) {
  if (!watches_) return;
  Eigen::MatrixXd& errors = state.carried();
  const Eigen::Matrix<double, 9, kColumns> moved = F.lazyProduct(errors.topRows<kInertialSize>());
  for (int i = kGnssBias; i < kWithoutCamera; ++i) errors.row(i) *= decay(i);
  errors.topRows<9>() = moved;
}

std::optional<StepDetector::Step> StepDetector::most_likely(double sigmas) const {
  if (!watches_) return std::nullopt;
  std::optional<Step> best;
  double most = sigmas * sigmas * std::max(1.0, usual_);
  for (int k = 0; k < kColumns; ++k) {
    if (!(information_(k) > 0.0)) continue;
    const double explained = sum_(k) * sum_(k) / information_(k);
    if (explained < most || explained < kMostOfIt * squares_(k)) continue;
    most = explained;
    best = Step{kSteps[static_cast<size_t>(k / kMoments)], sum_(k) / information_(k), 1.0 / information_(k), k};
  }
  return best;
}

}  // namespace roadfix::navigation
