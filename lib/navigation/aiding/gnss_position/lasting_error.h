/// What of a receiver's level errors lasts from fix to fix, and for how long: its fixes against the way that the filter
/// has driven (or its velocities against the propagated one), explained by models side by side (Magill 1965), (N.5.4) of
/// MODEL.md.
///
/// Per level axis each model is a filter of two states: the offset of the driven way, which drifts, and a first-order
/// Gauss-Markov error that has a share of the claimed variance; the rest is white. Only ratios count: how far the claim
/// is off as a whole is the noise scale's.
#pragma once

#include <Eigen/Dense>
#include <array>
#include <cstdint>

namespace roadfix::navigation {

struct LastingError {
  double share = 0.0;  ///< of the variance
  double rate = 1.0;   ///< 1/s, inverse of the correlation time
};

/// One used fix, m and m2 (or m/s), east and north.
struct WayFix {
  int64_t t_us = 0;
  Eigen::Vector2d before, after;  ///< its residual before and after its use, with the receiver's own error in it
  Eigen::Vector2d variance;       ///< as claimed
  Eigen::Vector2d drift_rate;     ///< m2/s, of the driven way, a random walk
};

class LastingErrorModels {
 public:
  static constexpr std::array kShares = {0.35, 0.7, 0.9};
  using Times = std::array<double, 3>;  ///< s
  static constexpr size_t kModels = 1 + kShares.size() * std::tuple_size_v<Times>;

  /// `white`: prior of the model in which nothing lasts; the others have the rest in equal parts.
  LastingErrorModels(const Times& times, double white) : times_(times), white_(white) {}

  /// The next fix is compared with none before it.
  void begin_anew() { t_us_ = 0; }
  void add(const WayFix& fix);
  /// Of the models as likely as each is.
  [[nodiscard]] LastingError mean() const;
  /// Variance of the errors over the claimed one, by the same weights.
  [[nodiscard]] double variance_factor() const;

  template <class Archive>
  void serialise(Archive& a) {
    a(t_us_, moved_, values_);
    for (Model& m : models_) {
      a(m.log_variance, m.squares);
      for (Axis& x : m.axes) a(x.d, x.b, x.dd, x.db, x.bb);
    }
  }

 private:
  struct Axis {
    double d = 0.0, b = 0.0, dd = 0.0, db = 0.0, bb = 0.0;  // offset, lasting error; their covariance
  };
  struct Model {
    std::array<Axis, 2> axes{};
    double log_variance = 0.0, squares = 0.0;  // means of ln S and of the normalised innovation squared
  };
  /// The first has nothing that lasts.
  [[nodiscard]] LastingError assumed(size_t i) const {
    if (i == 0) return {0.0, 1.0};
    return {kShares[(i - 1) / times_.size()], 1.0 / times_[(i - 1) % times_.size()]};
  }

  [[nodiscard]] std::array<double, kModels> weights() const;

  Times times_;
  double white_;
  int64_t t_us_ = 0;
  Eigen::Vector2d moved_ = Eigen::Vector2d::Zero();  // m, by all fixes since the first
  double values_ = 0.0;                              // how many values the means are of
  std::array<Model, kModels> models_{};
};

}  // namespace roadfix::navigation
