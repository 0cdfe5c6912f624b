/// What of a receiver's errors lasts, and for how long: its fixes against the way that the filter has driven, explained
/// by models side by side (Magill 1965), (M.48).
///
/// Per level axis each model is a filter of two states: the offset of the driven way, which drifts, and a first-order
/// Gauss-Markov error that has a share of the claimed variance; the rest is white. Only ratios count: whether the claim
/// is too small as a whole is another's question (noise_scale.h).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "gnss_ins/fix_error.h"
#include "samples/samples.h"

namespace roadfix {

/// How well each model has foretold the fixes of one kind.
class LastingEvidence {
 public:
  static constexpr std::array kShares = {0.35, 0.7, 0.9};
  static constexpr std::array kTimes = {5.0, 15.0, 50.0};  // s
  static constexpr size_t kModels = 1 + kShares.size() * kTimes.size();

  /// The first has nothing that lasts.
  static constexpr LastingShare model(size_t i) {
    if (i == 0) return {0.0, 1.0};
    return {kShares[(i - 1) / kTimes.size()], 1.0 / kTimes[(i - 1) % kTimes.size()]};
  }

  /// Mean of the models as likely as each is: of the share, and of what drives it, share times rate.
  [[nodiscard]] LastingShare mean() const;

  /// One more fix: mean ln S and mean normalised innovation squared of each model, over its axes, which count as many
  /// as `values` with what is remembered.
  void learn(double gain, double values, size_t i, double log_variance, double squares) {
    log_variance_[i] += gain * (log_variance - log_variance_[i]);
    squares_[i] += gain * (squares - squares_[i]);
    values_ = values;
  }
  [[nodiscard]] double values() const { return values_; }
  [[nodiscard]] double squares(size_t i) const { return squares_[i]; }

  template <class Archive>
  void serialise(Archive& a) {
    a(values_);
    for (size_t i = 0; i < kModels; ++i) a(log_variance_[i], squares_[i]);
  }

 private:
  double values_ = 0.0;                         ///< how many values the means below are of
  std::array<double, kModels> log_variance_{};  ///< ln S
  std::array<double, kModels> squares_{};       ///< innovation squared over S
};

/// One used fix, m and m2, east and north.
struct WatchedFix {
  int64_t t_us = 0;
  Eigen::Vector2d before, after;  ///< its residual before and after its use, with the receiver's own error in it
  Eigen::Vector2d variance;       ///< as claimed
  Eigen::Vector2d drift_rate;     ///< m2/s, of the driven way
};

class LastingWatch {
 public:
  /// The next fix is compared with none before it.
  void begin_anew() { t_us_ = 0; }
  void add(const WatchedFix& fix, LastingEvidence& evidence);

  template <class Archive>
  void serialise(Archive& a) {
    a(t_us_, moved_);
    for (auto& model : axes_)
      for (Axis& x : model) a(x.d, x.b, x.dd, x.db, x.bb);
  }

 private:
  struct Axis {
    double d = 0.0, b = 0.0, dd = 0.0, db = 0.0, bb = 0.0;  ///< offset, lasting error; their covariance
  };

  int64_t t_us_ = 0;
  Eigen::Vector2d moved_ = Eigen::Vector2d::Zero();  ///< m, by all fixes since the first
  std::array<std::array<Axis, 2>, LastingEvidence::kModels> axes_{};
};

}  // namespace roadfix
