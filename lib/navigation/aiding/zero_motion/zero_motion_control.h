/// When the car stands, and zero velocity and rate are used, (N.4.8) to (N.4.10) of MODEL.md.
#pragma once

#include "inertial/standstill.h"
#include "navigation/aiding/gates.h"
#include "navigation/filter.h"

namespace roadfix::navigation {

class ZeroMotionControl {
 public:
  explicit ZeroMotionControl(const NavigationConfig& config) : config_(config), gates_(config.aiding.gate_sigma) {}

  /// At the end of a block: calm samples, and a velocity that is zero or may be. `still`: the picture does not move; an engine
  /// that shakes the imu does not hide rest then.
  [[nodiscard]] bool standing(const Filter& filter, const inertial::StandstillDetector& standstill, bool frozen,
                              bool still) const;
  /// `calm`: the imu alone says so; else the picture, which leaves slow motion unseen.
  AidingRecord use_velocity(Filter& filter, bool gated, bool calm) const;
  AidingRecord use_rate(Filter& filter, const inertial::ImuBlock& block, bool gated, bool calm) const;

 private:
  NavigationConfig config_;
  Gates gates_;
};

}  // namespace roadfix::navigation
