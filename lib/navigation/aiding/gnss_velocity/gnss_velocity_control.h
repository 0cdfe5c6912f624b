/// When and with what noise a GNSS velocity is used, (N.5.4) of MODEL.md: white noise with an adaptive scale and a
/// Gauss-Markov state, because receivers low-pass filter their velocities.
#pragma once

#include "navigation/aiding/gates.h"
#include "navigation/aiding/gnss_position/lasting_error.h"
#include "navigation/aiding/noise_scale.h"
#include "navigation/measurement_queue.h"

namespace roadfix::navigation {

class GnssVelocityControl {
 public:
  explicit GnssVelocityControl(const NavigationConfig& config)
      : has_imu_(config.facts.has_imu), lasting_(config.aiding.lasting_errors), gates_(config.aiding.gate_sigma) {}

  AidingRecord use(Filter& filter, const Queued& velocity);
  AidingRecord try_on(Filter& filter, const Queued& velocity) const;
  /// The way driven is broken: older velocities are not compared with newer ones.
  void forget_way() { models_.begin_anew(); }

  template <class Archive>
  void serialise(Archive& a) {
    scale_.serialise(a);
    models_.serialise(a);
    a(rejected_, last_us_);
  }

 private:
  [[nodiscard]] LastingError lasting() const;
  AidingRecord fuse(Filter& filter, const Queued& velocity, double gate) const;
  void watch(Filter& filter, const Queued& velocity, const Eigen::Vector2d& before);

  bool has_imu_, lasting_;
  Gates gates_;
  NoiseScale scale_;
  LastingErrorModels models_{{0.5, 2.0, 8.0}};  // s: filters of receivers, and multipath of a moving antenna
  int rejected_ = 0;
  int64_t last_us_ = 0;
};

}  // namespace roadfix::navigation
