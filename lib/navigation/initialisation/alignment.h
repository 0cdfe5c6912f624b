/// From the first samples and fixes to one filter with a known heading: which strategy starts, and the hypotheses that
/// follow it, (N.7) of MODEL.md.
#pragma once

#include "navigation/initialisation/heading_hypotheses.h"
#include "navigation/level_frame.h"

namespace roadfix::navigation {

class Alignment {
 public:
  explicit Alignment(const NavigationConfig& config) : config_(config), hypotheses_(config) {}

  void see_first_sample(int64_t t_us) {
    if (first_us_ == 0) first_us_ = t_us;
  }
  /// s since the first sample.
  [[nodiscard]] double waited(int64_t t_us) const { return seconds_between(first_us_, t_us); }
  /// A fix that passed the screen, for the start.
  void add(const GnssFix& fix);
  /// At the end of a block; true: the hypotheses have started, and everything stamped up to t_us is used. `bias_std`,
  /// `return_std`: of the newest fix, m, level axes.
  bool try_start(int64_t t_us, const inertial::StandstillDetector& standstill, LevelFrame& frame,
                 const Eigen::Vector3d& bias_std, const Eigen::Vector3d& return_std);
  [[nodiscard]] HeadingHypotheses& hypotheses() { return hypotheses_; }
  [[nodiscard]] const HeadingHypotheses& hypotheses() const { return hypotheses_; }
  [[nodiscard]] const std::optional<GnssFix>& fix() const { return fix_; }
  [[nodiscard]] const std::optional<Memory>& memory() const { return memory_; }
  void recall(const Memory& memory) { memory_ = memory; }
  /// Started where it was parked, and no fix has agreed yet.
  [[nodiscard]] bool parked() const { return parked_; }
  void fix_agreed() { parked_ = false; }
  [[nodiscard]] bool remembers_heading() const { return memory_ && memory_->parked; }
  /// The remembered place did not hold; sensor errors are kept.
  void forget_place();

  /// `earth`: of the level frame.
  template <class Archive>
  void serialise(Archive& a, const inertial::Earth& earth) {
    hypotheses_.serialise(a, earth);
    for (std::optional<GnssFix>* fix : {&fix_, &fix_before_})
      serialise_optional(
          a, *fix, [] { return GnssFix(); }, [&](GnssFix& f) { serialise_fix(a, f); });
    serialise_optional(
        a, memory_, [] { return Memory(); }, [&](Memory& m) { m.serialise(a); });
    a(first_us_, parked_);
  }

 private:
  NavigationConfig config_;
  HeadingHypotheses hypotheses_;
  std::optional<GnssFix> fix_, fix_before_;
  std::optional<Memory> memory_;
  int64_t first_us_ = 0;
  bool parked_ = false;
};

}  // namespace roadfix::navigation
