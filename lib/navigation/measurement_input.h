/// From the sensors' samples to the queue of measurements: fixes are screened, and what comes more often than it says
/// anything new is thinned out.
#pragma once

#include "navigation/aiding/gnss_screen.h"
#include "navigation/input_adapter.h"
#include "vehicle/speed_rounding.h"

namespace roadfix::navigation {

class MeasurementInput {
 public:
  explicit MeasurementInput(const NavigationConfig& config) : config_(config), screen_(config.screen) {}

  /// By the receiver's own figures. One that was added already is bad input, and so is the same place to the last bit of a
  /// car that moves: at `speed` (m/s, 0 where nobody but the receiver tells) or by the fix's own velocity.
  AidingStatus screen(const GnssFix& fix, double speed);
  /// A fix that passed, in the enu frame of `anchor`.
  void add(const GnssFix& fix, int64_t id, const Geodetic& anchor);
  /// Every sample of the wheels, before it is added.
  void see(const WheelSample& wheels) { rounding_.observe(wheels); }
  /// Of the wheels or the magnetometer.
  void add(Queued q);

  [[nodiscard]] MeasurementQueue& queue() { return queue_; }
  [[nodiscard]] const GnssScreen& gnss() const { return screen_; }
  /// The receiver is still the one that `other` has screened.
  void keep_screen(const MeasurementInput& other) { screen_ = other.screen_; }

  template <class Archive>
  void serialise(Archive& a) {
    screen_.serialise(a);
    queue_.serialise(a);
    rounding_.serialise(a);
    a(last_fix_us_, last_fix_.latitude, last_fix_.longitude, last_fix_.height, last_wheel_us_, last_magnetic_us_);
  }

 private:
  NavigationConfig config_;
  GnssScreen screen_;
  MeasurementQueue queue_;
  vehicle::SpeedRounding rounding_;
  int64_t last_fix_us_ = 0;
  Geodetic last_fix_;
  int64_t last_wheel_us_ = 0, last_magnetic_us_ = 0;
};

}  // namespace roadfix::navigation
