/// How large errors are against what was claimed for them, and how heavy their tails: the posterior predictive of an
/// error whose scale is known from a few normalised squares only is Student's t, lib/integrity/MODEL.md (P.2.n).
/// Squares are given in order of time. The same squares give the same bits. Not thread safe.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <utility>

#include "integrity/integrity_config.h"

namespace roadfix {

class ErrorScale {
 public:
  explicit ErrorScale(const ErrorScaleConfig& config) : config_(config) {}

  /// `squares`: sum of `dof` squared normalised errors at one time.
  void add(int64_t t_us, double squares, double dof);

  /// Degrees of freedom of the predictive distribution at a time, (P.2.2): fewer the longer nothing was seen.
  [[nodiscard]] double dof(int64_t t_us) const;
  /// Its scale, claimed sigmas, (P.2.3).
  [[nodiscard]] double scale(int64_t t_us) const;
  /// Exceeded by the error's magnitude with probability `risk`, claimed sigmas, (P.2.4). The scale counts as `least`
  /// at least: squares below what was claimed do not make a bound smaller than the claim.
  [[nodiscard]] double quantile(int64_t t_us, double risk, double least = 1.0) const;

  /// Everything that later results depend on but the configuration; likewise below.
  template <class Self, class Archive>
  static void archive(Self& self, Archive& a) {
    a(self.last_us_, self.weight_, self.squares_);
  }

 private:
  [[nodiscard]] double kept(int64_t t_us) const;
  [[nodiscard]] double tail(double risk, double dof) const;

  ErrorScaleConfig config_;
  std::optional<int64_t> last_us_;
  double weight_ = 0.0;                                     ///< at last_us_: degrees of freedom that count
  double squares_ = 0.0;                                    ///< their squares
  mutable std::map<std::pair<double, int>, double> tails_;  ///< quantiles once computed, a thousandfold the cost
};

}  // namespace roadfix
