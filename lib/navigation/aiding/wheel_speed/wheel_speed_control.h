/// When a wheel speed is used, (N.4.6) and (N.5.7) of MODEL.md: its sign, and a scale that has stepped.
#pragma once

#include "navigation/aiding/gates.h"
#include "navigation/measurement_queue.h"

namespace roadfix::navigation {

class WheelSpeedControl {
 public:
  static constexpr double kSilent = 0.3;  ///< s without a wheel speed: longer, and there is none

  explicit WheelSpeedControl(const NavigationConfig& config)
      : detects_steps_(config.aiding.step_detection),
        interval_(config.aiding.wheel_interval),
        gates_(config.aiding.gate_sigma) {}

  AidingRecord use(Filter& filter, const Queued& wheels);
  AidingRecord try_on(Filter& filter, const Queued& wheels) const;
  [[nodiscard]] int64_t scale_steps() const { return scale_steps_; }  ///< after which the scale was widened

  template <class Archive>
  void serialise(Archive& a) {
    a(rejected_since_us_, excess_sum_, excess_least_, excess_most_, rejected_, scale_steps_);
  }

 private:
  void widen_scale(Filter& filter, const Queued& wheels, const AidingRecord& r);

  bool detects_steps_;
  double interval_;  // s
  Gates gates_;
  int64_t rejected_since_us_ = 0;
  double excess_sum_ = 0.0, excess_least_ = 0.0, excess_most_ = 0.0;  // relative, of rejected speeds in a row
  int rejected_ = 0;
  int64_t scale_steps_ = 0;
};

}  // namespace roadfix::navigation
