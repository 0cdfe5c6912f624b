/// The aiding sources of one filter and the table that lists them: what is queued goes to the source of its kind, and
/// what keeps its own time (constraint, standstill) is used at imu epochs.
#pragma once

#include <span>

#include "inertial/standstill.h"
#include "navigation/aiding/gnss_position/gnss_position_control.h"
#include "navigation/aiding/gnss_velocity/gnss_velocity_control.h"
#include "navigation/aiding/nonholonomic/nonholonomic_control.h"
#include "navigation/aiding/wheel_speed/wheel_speed_control.h"
#include "navigation/aiding/zero_motion/zero_motion_control.h"

namespace roadfix::navigation {

class Aiding {
 public:
  explicit Aiding(const NavigationConfig& config);

  /// What a source makes of a queued measurement; `trial`: for a hypothesis of the start, no gate and no learning.
  AidingRecord use(Filter& filter, const Queued& q);
  AidingRecord try_on(Filter& filter, const Queued& q) const;
  [[nodiscard]] static AidingSource source_of(Queued::Kind kind);

  [[nodiscard]] NonholonomicControl& nonholonomic() { return nonholonomic_; }
  [[nodiscard]] const ZeroMotionControl& zero_motion() const { return zero_motion_; }
  [[nodiscard]] const WheelSpeedControl& wheel_speed() const { return wheel_speed_; }
  [[nodiscard]] GnssPositionControl& gnss_position() { return gnss_position_; }
  /// The filter's way is broken by a step that was taken back: no source compares what came before with what comes.
  void forget_way() {
    gnss_position_.forget_way();
    gnss_velocity_.forget_way();
  }
  [[nodiscard]] const GnssPositionControl& gnss_position() const { return gnss_position_; }

  template <class Archive>
  void serialise(Archive& a) {
    gnss_position_.serialise(a);
    gnss_velocity_.serialise(a);
    wheel_speed_.serialise(a);
    nonholonomic_.serialise(a);
  }

 private:
  AidingRecord heading(Filter& filter, const Queued& q, double gate) const;
  AidingRecord magnetic(Filter& filter, const Queued& q, double gate) const;

  NavigationConfig config_;
  Gates gates_;
  GnssPositionControl gnss_position_;
  GnssVelocityControl gnss_velocity_;
  WheelSpeedControl wheel_speed_;
  NonholonomicControl nonholonomic_;
  ZeroMotionControl zero_motion_;
};

}  // namespace roadfix::navigation
