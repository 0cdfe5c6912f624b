/// When the non-holonomic constraint is used and with what noise, which it learns while GNSS shows the truth, (V.3).
#pragma once

#include "navigation/aiding/gates.h"
#include "navigation/filter.h"
#include "vehicle/nonholonomic_noise.h"

namespace roadfix::navigation {

class NonholonomicControl {
 public:
  explicit NonholonomicControl(const NavigationConfig& config)
      : config_(config),
        gates_(config.aiding.gate_sigma),
        lateral_(config.nonholonomic, vehicle::NonholonomicNoise::Axis::kLateral),
        vertical_(config.nonholonomic, vehicle::NonholonomicNoise::Axis::kVertical) {}

  /// Where wheel speeds come, the constraint joins them: one epoch of updates instead of two. `wheels`: one has just come.
  [[nodiscard]] bool joins(bool wheels, int64_t t_us);
  /// Wheel speeds have come.
  [[nodiscard]] bool with_wheels() const { return wheels_at_us_ != 0; }
  /// True when the constraint of this axis (1 lateral, 2 vertical) is due at t_us; counts it as used.
  bool due(int axis, int64_t t_us);
  /// `learn`: fixes show the truth beside it.
  AidingRecord use(Filter& filter, int axis, bool learn);
  AidingRecord try_on(Filter& filter, int axis) const;

  template <class Archive>
  void serialise(Archive& a) {
    lateral_.serialise(a);
    vertical_.serialise(a);
    a(next_us_[0], next_us_[1], wheels_at_us_);
  }

 private:
  [[nodiscard]] double sigma(const Filter& filter, int axis) const;
  [[nodiscard]] double interval(int axis) const;  ///< s between two uses

  NavigationConfig config_;
  Gates gates_;
  vehicle::NonholonomicNoise lateral_, vertical_;
  std::array<int64_t, 2> next_us_{};
  int64_t wheels_at_us_ = 0;
};

}  // namespace roadfix::navigation
