#include "gnss_ins/scale_steps.h"

#include <algorithm>

namespace roadfix {

namespace {

constexpr int64_t kApart_us = 1'000'000;  // between two moments
constexpr double kMostOfIt = 0.5;         // of what the innovations have too much, at least, is the step's

}  // namespace

void ScaleSteps::begin(Since& s) {
  s = Since();
  s.per_unit(kWheelScale) = 1.0;
}

/// Two moments per octave: of one second the first two take turns, of two seconds the next two, ...
void ScaleSteps::advance(int64_t t_us) {
  if (!follows_ || t_us < next_us_) return;
  next_us_ = t_us + kApart_us;
  ++turn_;
  for (int octave = 0; octave < kOctaves; ++octave) {
    const int period = 1 << octave;
    if (turn_ % period != 0) break;
    begin(since_[static_cast<size_t>(2 * octave + (turn_ / period) % 2)]);
  }
}

void ScaleSteps::move(const Transition& phi) {
  if (!follows_) return;
  for (Since& s : since_) {
    const Eigen::Matrix<double, 9, 1> moved =
        phi.moved_by.transpose().lazyProduct(s.per_unit.head<kInertialStates + 3>());
    s.per_unit = s.per_unit.cwiseProduct(phi.decay);
    s.per_unit.head<9>() = moved;
  }
}

std::optional<ScaleSteps::Since> ScaleSteps::most_likely(double sigmas) const {
  std::optional<Since> best;
  double most = sigmas * sigmas * std::max(1.0, usual_);
  for (const Since& s : since_) {
    if (!(s.information > 0.0)) continue;
    const double explained = s.size() * s.sum;
    if (explained < most || explained < kMostOfIt * (s.squares - s.rows)) continue;
    most = explained;
    best = s;
  }
  return best;
}

}  // namespace roadfix
