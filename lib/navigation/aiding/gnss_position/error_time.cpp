#include "navigation/aiding/gnss_position/error_time.h"

#include <algorithm>
#include <cmath>

#include "samples/samples.h"

namespace roadfix::navigation {

namespace {

constexpr double kSpacing = 1.0;       // s between two fixes that count
constexpr double kPriorWeight = 10.0;  // independent differences that the prior counts for
constexpr double kMemory = 300.0;      // likewise, of what is seen
constexpr double kMostSquare = 9.0;    // one difference counts at most as three sigma
// Of a difference's variance, at most, that the way's error may be. `way_std` adds up amplitudes, the most that it can be.
constexpr double kWayShare = 4.0;
constexpr std::array kTimes = {2.0, 3.0, 4.5, 7.0, 10.0, 14.0, 20.0, 30.0, 45.0};  // s, that are distinguished

constexpr double kLeastShare = 0.02, kMostShare = 0.95;
constexpr double kShareGain = 0.01;   // per fix, of the correlation of successive innovations
constexpr double kMostProduct = 4.0;  // of two whitened innovations: outliers count no more

double lag_of(int i) { return static_cast<double>(1 << i); }

}  // namespace

void ErrorTime::see_innovation(const Eigen::Vector2d& whitened) {
  const double product = std::clamp(0.5 * whitened.dot(whitened_), -kMostProduct, kMostProduct);
  share_ = std::clamp(share_ + kShareGain * product, kLeastShare, kMostShare);
  whitened_ = whitened;
}

ErrorTime::ErrorTime() {
  for (int i = 0; i < kLags; ++i) structure_(i) = 1.0 - kPriorShare * std::exp(-lag_of(i) / kPrior);
  weight_.setConstant(kPriorWeight);
}

void ErrorTime::add(int64_t t_us, const Eigen::Vector2d& fix_less_way, const Eigen::Vector2d& std, double way_std) {
  if (count_ > 0 && seconds_between(before(1).t_us, t_us) < kSpacing - 1e-3) return;
  const Fix now{t_us, fix_less_way, std, way_std};
  compare(now);
  fixes_[static_cast<size_t>(next_)] = now;
  next_ = (next_ + 1) % kFixes;
  count_ = std::min(count_ + 1, kFixes);
  fit();
}

void ErrorTime::compare(const Fix& now) {
  int steps = 1;
  for (int i = 0; i < kLags; ++i) {
    while (steps <= count_ && seconds_between(before(steps).t_us, now.t_us) < lag_of(i) - 0.5 * kSpacing) ++steps;
    if (steps > count_) return;
    const Fix& then = before(steps);
    if (seconds_between(then.t_us, now.t_us) > 1.5 * lag_of(i)) continue;
    const Eigen::Array2d variance = now.std.array().square() + then.std.array().square();
    const double way = now.way_std - then.way_std;
    if (way * way > kWayShare * variance.mean()) return;
    const Eigen::Array2d squares = (now.value - then.value).array().square() / variance;
    // Differences over a long lag overlap: each adds a new second of so many.
    const double counts = kSpacing / std::max(lag_of(i), kSpacing);
    weight_(i) = std::min(weight_(i) + counts, kMemory);
    structure_(i) += counts / weight_(i) * (squares.min(kMostSquare).mean() - structure_(i));
  }
}

/// Weighted least squares for A and B at every tau of the list.
void ErrorTime::fit() {
  double least = INFINITY;
  for (const double tau : kTimes) {
    Eigen::Matrix2d N = Eigen::Matrix2d::Zero();
    Eigen::Vector2d b = Eigen::Vector2d::Zero();
    for (int i = 0; i < kLags; ++i) {
      const Eigen::Vector2d row(1.0, -std::exp(-lag_of(i) / tau));
      N += weight_(i) * row * row.transpose();
      b += weight_(i) * structure_(i) * row;
    }
    const Eigen::Vector2d fit = N.inverse() * b;
    double squares = 0.0;
    for (int i = 0; i < kLags; ++i) {
      const double off = structure_(i) - (fit(0) - fit(1) * std::exp(-lag_of(i) / tau));
      squares += weight_(i) * off * off;
    }
    if (squares >= least || fit(1) <= 0.0) continue;
    least = squares;
    time_ = tau;
  }
}

}  // namespace roadfix::navigation
