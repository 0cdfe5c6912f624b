#include "navigation/aiding/gnss_position/lasting_error.h"

#include <algorithm>
#include <cmath>

#include "samples/samples.h"

namespace roadfix::navigation {

namespace {

constexpr double kAxes = 2.0;
// Least share: with none it could not be scaled where it turns out to be more, (N.5.12).
constexpr double kLeast = 1e-4;
constexpr double kLeastWeight = -100.0;  // logarithm, against the best model
constexpr double kLeastSquares = 1e-6;
constexpr double kMemory = 180.0;    // s: a few of the longest times that are looked for
constexpr double kMostRatio = 16.0;  // one fix counts at most as four sigma, at a model's own scale

}  // namespace

std::array<double, LastingErrorModels::kModels> LastingErrorModels::weights() const {
  std::array<double, kModels> log_weight{};
  for (size_t i = 0; i < kModels; ++i) {
    log_weight[i] = std::log(i == 0 ? white_ : (1.0 - white_) / (kModels - 1.0));
    // Likelihood at the model's own best scale.
    if (values_ > 0.0)
      log_weight[i] -=
          0.5 * values_ * (models_[i].log_variance + std::log(std::max(models_[i].squares, kLeastSquares)));
  }
  const double most = *std::max_element(log_weight.begin(), log_weight.end());
  double total = 0.0;
  for (double& w : log_weight) total += w = std::exp(std::max(w - most, kLeastWeight));
  for (double& w : log_weight) w /= total;
  return log_weight;
}

LastingError LastingErrorModels::mean() const {
  const std::array<double, kModels> weight = weights();
  double share = 0.0, driven = 0.0;
  for (size_t i = 0; i < kModels; ++i) {
    const LastingError e = assumed(i);
    share += weight[i] * e.share;
    driven += weight[i] * e.share * e.rate;
  }
  return {std::max(share, kLeast), driven / share};
}

double LastingErrorModels::variance_factor() const {
  if (values_ <= 0.0) return 1.0;
  const std::array<double, kModels> weight = weights();
  double factor = 0.0;
  for (size_t i = 0; i < kModels; ++i) factor += weight[i] * models_[i].squares;
  return factor;
}

void LastingErrorModels::add(const WayFix& fix) {
  const bool first = t_us_ == 0;
  const double dt = first ? 0.0 : seconds_between(t_us_, fix.t_us);
  if (!first && dt <= 0.0) return;
  t_us_ = fix.t_us;
  if (first) moved_.setZero();
  const Eigen::Vector2d off = fix.before + moved_;  // of the fix from the way as driven
  moved_ += fix.before - fix.after;
  const double gain = std::max(1.0 - std::exp(-dt / kMemory), kAxes / (values_ + kAxes));
  if (!first) values_ = kAxes / gain;
  for (size_t i = 0; i < kModels; ++i) {
    const LastingError like = assumed(i);
    Model& model = models_[i];
    const double keep = std::exp(-dt * like.rate);
    double log_variance = 0.0, squares = 0.0;
    for (int k = 0; k < 2; ++k) {
      Axis& x = model.axes[static_cast<size_t>(k)];
      const double lasting = like.share * fix.variance(k), white = fix.variance(k) - lasting;
      if (first) {
        x = {off(k), 0.0, fix.variance(k), -lasting, lasting};
        continue;
      }
      x.b *= keep;
      x.db *= keep;
      x.bb = keep * keep * x.bb + (1.0 - keep * keep) * lasting;
      x.dd += fix.drift_rate(k) * dt;
      const double by_d = x.dd + x.db, by_b = x.db + x.bb, S = by_d + by_b + white;
      const double residual = off(k) - x.d - x.b;
      x.d += by_d / S * residual;
      x.b += by_b / S * residual;
      x.dd -= by_d * by_d / S;
      x.db -= by_d * by_b / S;
      x.bb -= by_b * by_b / S;
      log_variance += std::log(S) / kAxes;
      squares += std::min(residual * residual / S, kMostRatio * std::max(1.0, model.squares)) / kAxes;
    }
    if (first) continue;
    model.log_variance += gain * (log_variance - model.log_variance);
    model.squares += gain * (squares - model.squares);
  }
}

}  // namespace roadfix::navigation
