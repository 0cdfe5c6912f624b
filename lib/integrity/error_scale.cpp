#include "integrity/error_scale.h"

#include <algorithm>
#include <cmath>

#include "samples/samples.h"
#include "statistics/student_t.h"

namespace roadfix {
namespace {

constexpr double kDofSteps = 4.0;        // per degree of freedom; rounded down, to the heavier tail
constexpr double kLargestSquare = 36.0;  // of one degree of freedom: a gated spike is evidence of tails, once

}  // namespace

void ErrorScale::add(int64_t t_us, double squares, double dof) {
  if (!(squares >= 0.0) || !(dof > 0.0)) return;
  double share = 1.0;
  if (last_us_) {
    const double dt = seconds_between(*last_us_, t_us);
    if (dt < 0.0) return;
    const double kept_share = kept(t_us);
    weight_ *= kept_share;
    squares_ *= kept_share;
    if (config_.correlation > 0.0) share = std::min(1.0, dt / config_.correlation);
  }
  last_us_ = t_us;
  weight_ += share * dof;
  squares_ += share * std::min(squares, kLargestSquare * dof);
}

double ErrorScale::kept(int64_t t_us) const {
  return last_us_ ? std::exp(-std::max(0.0, seconds_between(*last_us_, t_us)) / config_.memory) : 0.0;
}

double ErrorScale::dof(int64_t t_us) const { return config_.prior_dof + kept(t_us) * weight_; }

double ErrorScale::scale(int64_t t_us) const {
  return std::sqrt((config_.prior_dof + kept(t_us) * squares_) / dof(t_us));
}

double ErrorScale::quantile(int64_t t_us, double risk, double least) const {
  return std::max(least, scale(t_us)) * tail(risk, dof(t_us));
}

double ErrorScale::tail(double risk, double dof) const {
  const int step = static_cast<int>(dof * kDofSteps);
  const auto [entry, is_new] = tails_.try_emplace({risk, step}, 0.0);
  if (is_new) entry->second = -student_t_quantile(0.5 * risk, step / kDofSteps);
  return entry->second;
}

}  // namespace roadfix
