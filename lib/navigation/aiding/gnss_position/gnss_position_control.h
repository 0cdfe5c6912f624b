/// When and with what noise a GNSS position is used: the one error model of a receiver, (N.5) of MODEL.md.
///
/// A position is h + b + n: n white with an adaptive scale, b a Gauss-Markov state. What the gate rejects is a single
/// outlier, a displaced receiver or a wrong filter; runs of rejected fixes that agree with each other are decided by
/// the likelihoods of the last two under heavy-tailed priors: b or the filter is widened by what they differ.
#pragma once

#include <array>

#include "navigation/aiding/gates.h"
#include "navigation/aiding/noise_scale.h"
#include "navigation/measurement_queue.h"

namespace roadfix::navigation {

class GnssPositionControl {
 public:
  explicit GnssPositionControl(const NavigationConfig& config) : config_(config), gates_(config.aiding.gate_sigma) {}

  /// `status` kReset: the filter was found wrong and took the fix.
  AidingRecord use(Filter& filter, const Queued& fix);
  /// For a hypothesis of the start: no gate, no learning.
  AidingRecord try_on(Filter& filter, const Queued& fix) const;
  /// Prepares a filter for fixes of this type: stationary sigma of its bias, and the bias itself for the first one.
  void begin(Filter& filter, const Queued& fix) const;

  /// A fix was tried on the hypotheses of a start.
  void tried(const Queued& fix) {
    tried_at_us_ = fix.t_us;
    last_type_ = fix.fix_type;
  }
  /// m, of the Gauss-Markov error in a fix, level axes.
  [[nodiscard]] Eigen::Vector3d lasting_std(const GnssFix& fix) const;

  [[nodiscard]] int rejected() const { return rejected_; }  ///< in a row
  [[nodiscard]] bool displaced() const { return displaced_; }
  [[nodiscard]] bool height_differs() const { return height_differs_; }
  /// The filter has lost its past (a gap, a new start): nothing holds against the receiver.
  void clear_run() { rejected_ = 0; }

  template <class Archive>
  void serialise(Archive& a) {
    for (NoiseScale& s : scale_) s.serialise(a);
    a(used_at_us_, tried_at_us_, last_type_, rejected_, first_off_, displaced_, height_differs_);
  }

 private:
  [[nodiscard]] Measurement<3> measurement(const Filter& filter, const Queued& fix) const;
  [[nodiscard]] double scale(FixType type) const { return scale_[static_cast<size_t>(type)].variance_factor(); }
  AidingRecord use_level(Filter& filter, const Queued& fix);
  AidingRecord decide(Filter& filter, const Queued& fix, const AidingRecord& rejected);
  void widen_filter(Filter& filter, const Queued& fix, const Eigen::Vector3d& off) const;

  NavigationConfig config_;
  Gates gates_;
  std::array<NoiseScale, 6> scale_;  // by FixType
  int64_t used_at_us_ = 0, tried_at_us_ = 0;
  FixType last_type_ = FixType::kNone;
  int rejected_ = 0;
  Eigen::Vector3d first_off_ = Eigen::Vector3d::Zero();  // innovation of the first of a run of rejected fixes
  bool displaced_ = false, height_differs_ = false;
};

}  // namespace roadfix::navigation
