#include "gnss_ins/lasting_watch.h"

namespace roadfix {

namespace {

constexpr double kAxes = 2.0;
// Prior of the model in which nothing lasts; the others have the rest in equal parts. An honest receiver must not pay
// while it shows itself; what lasts is seen soon enough.
constexpr double kWhite = 0.9;
// Least share: with none the fixes could not be shared out anew where it turns out to be more, (M.49).
constexpr double kLeast = 1e-4;
constexpr double kNoBelief = -100.0;  // so that each model has some share
constexpr double kNoSpread = 1e-6;
constexpr double kMemory = 180.0;    // s: a few of the longest errors that are looked for
constexpr double kMostRatio = 16.0;  // one fix counts at most as four sigma, of a model's own scale

}  // namespace

LastingShare LastingEvidence::mean() const {
  std::array<double, kModels> belief{};
  for (size_t i = 0; i < kModels; ++i) {
    belief[i] = std::log(i == 0 ? kWhite : (1.0 - kWhite) / (kModels - 1.0));
    if (values_ > 0.0) belief[i] -= 0.5 * values_ * (log_variance_[i] + std::log(std::max(squares_[i], kNoSpread)));
  }
  const double most = *std::max_element(belief.begin(), belief.end());
  double total = 0.0, share = 0.0, driven = 0.0;
  for (size_t i = 0; i < kModels; ++i) {
    const double weight = std::exp(std::max(belief[i] - most, kNoBelief));
    const LastingShare m = model(i);
    total += weight;
    share += weight * m.share;
    driven += weight * m.share * m.rate;
  }
  return {std::max(share / total, kLeast), driven / share};
}

void LastingWatch::add(const WatchedFix& fix, LastingEvidence& evidence) {
  const bool first = t_us_ == 0;
  const double dt = first ? 0.0 : seconds_between(t_us_, fix.t_us);
  if (!first && dt <= 0.0) return;
  t_us_ = fix.t_us;
  if (first) moved_.setZero();
  const Eigen::Vector2d off = fix.before + moved_;  // of the fix from the way as driven
  moved_ += fix.before - fix.after;
  const double gain = std::max(1.0 - std::exp(-dt / kMemory), kAxes / (evidence.values() + kAxes));
  for (size_t i = 0; i < LastingEvidence::kModels; ++i) {
    const LastingShare like = LastingEvidence::model(i);
    const double keep = std::exp(-dt * like.rate);
    double log_variance = 0.0, squares = 0.0;
    for (int k = 0; k < 2; ++k) {
      Axis& x = axes_[i][static_cast<size_t>(k)];
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
      squares += std::min(residual * residual / S, kMostRatio * std::max(1.0, evidence.squares(i))) / kAxes;
    }
    if (!first) evidence.learn(gain, kAxes / gain, i, log_variance, squares);
  }
}

}  // namespace roadfix
