/// When and with what noise a GNSS velocity is used, (N.5.4) of MODEL.md: white noise with an adaptive scale and a
/// Gauss-Markov state, because receivers low-pass filter their velocities.
#pragma once

#include "navigation/aiding/gates.h"
#include "navigation/aiding/noise_scale.h"
#include "navigation/measurement_queue.h"

namespace roadfix::navigation {

class GnssVelocityControl {
 public:
  explicit GnssVelocityControl(const NavigationConfig& config)
      : lasting_(config.aiding.lasting_errors), gates_(config.aiding.gate_sigma) {}

  AidingRecord use(Filter& filter, const Queued& velocity);
  AidingRecord try_on(Filter& filter, const Queued& velocity) const;

  template <class Archive>
  void serialise(Archive& a) {
    scale_.serialise(a);
    a(rejected_);
  }

 private:
  AidingRecord fuse(Filter& filter, const Queued& velocity, double gate) const;

  bool lasting_;
  Gates gates_;
  NoiseScale scale_;
  int rejected_ = 0;
};

}  // namespace roadfix::navigation
