/// What of a receiver's level errors lasts, from the whiteness of innovations (Mehra 1970), and how long, from its fixes
/// against the way that the car is known to have gone: the structure function D(L) = E |e(t) - e(t - L)|^2 / 2 sigma^2 =
/// A - B exp(-L / tau), (N.5.14) of MODEL.md. Multipath lasts seconds where the car moves past what reflects, a minute
/// where it stands, and the ionosphere's error longer.
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cstdint>

namespace roadfix::navigation {

class ErrorTime {
 public:
  static constexpr double kPrior = 20.0;  ///< s: multipath and code smoothing (Misra and Enge 2006, ch. 5)

  ErrorTime();

  /// A fix less the way gone, m, level; `std`: m, of the fix; fixes less than a second apart count as one. `way_std`: m,
  /// grown as the way's error may have: where that is as large as the fixes', nothing is learnt.
  void add(int64_t t_us, const Eigen::Vector2d& fix_less_way, const Eigen::Vector2d& std, double way_std);
  /// The way is lost (a reset): older fixes are not compared any more.
  void clear() { count_ = 0; }
  [[nodiscard]] double time() const { return time_; }    ///< s
  [[nodiscard]] double share() const { return share_; }  ///< of the variance
  /// Of a used fix, level, over their standard deviations.
  void see_innovation(const Eigen::Vector2d& whitened);
  /// Variance of the errors over the claimed one, at least: half of what two fixes differ that are 16 s apart.
  [[nodiscard]] double variance_factor() const { return std::max(1.0, structure_(4)); }

  template <class Archive>
  void serialise(Archive& a) {
    for (Fix& f : fixes_) a(f.t_us, f.value, f.std, f.way_std);
    a(next_, count_, structure_, weight_, time_, share_, whitened_);
  }

 private:
  static constexpr int kLags = 6;  ///< of 1, 2, 4, ... s
  static constexpr int kFixes = 40;
  static constexpr double kPriorShare = 0.7;  ///< of a code receiver's variance
  struct Fix {
    int64_t t_us = 0;
    Eigen::Vector2d value = Eigen::Vector2d::Zero(), std = Eigen::Vector2d::Zero();
    double way_std = 0.0;
  };
  [[nodiscard]] const Fix& before(int steps) const {
    return fixes_[static_cast<size_t>((next_ - steps + 2 * kFixes) % kFixes)];
  }
  void compare(const Fix& now);
  void fit();

  std::array<Fix, kFixes> fixes_;
  int next_ = 0, count_ = 0;
  Eigen::Matrix<double, kLags, 1> structure_, weight_;
  double time_ = kPrior, share_ = kPriorShare;
  Eigen::Vector2d whitened_ = Eigen::Vector2d::Zero();
};

}  // namespace roadfix::navigation
