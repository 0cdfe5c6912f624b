/// When and with what noise a GNSS velocity is used, (N.5.4) of MODEL.md: white noise with an adaptive scale, a
/// Gauss-Markov state, and the receiver's low pass, whose time constant is learnt.
#pragma once

#include "navigation/aiding/gates.h"
#include "navigation/aiding/gnss_position/lasting_error.h"
#include "navigation/aiding/gnss_velocity/smoothing_time.h"
#include "navigation/aiding/noise_scale.h"
#include "navigation/measurement_queue.h"

namespace roadfix::navigation {

class GnssVelocityControl {
 public:
  static constexpr double kTimed = 0.01;  ///< s, sigma of a latency that is as good as known

  explicit GnssVelocityControl(const NavigationConfig& config)
      : has_imu_(config.facts.has_imu),
        lasting_(config.aiding.lasting_errors),
        timed_(ClockPriors(config.facts).velocity_latency < kTimed),
        gates_(config.aiding.gate_sigma),
        smoothing_(ClockPriors(config.facts).velocity_latency) {}

  AidingRecord use(Filter& filter, const Queued& velocity);
  AidingRecord try_on(Filter& filter, const Queued& velocity) const;
  /// The way driven is broken: older velocities are not compared with newer ones.
  void forget_way() { models_.begin_anew(); }

  template <class Archive>
  void serialise(Archive& a) {
    scale_.serialise(a);
    models_.serialise(a);
    smoothing_.serialise(a);
    a(rejected_, last_us_);
  }

 private:
  [[nodiscard]] LastingError lasting() const;
  /// With the low pass as it is known; `white`: share of the claimed variance.
  [[nodiscard]] Measurement<3> measurement(const Filter& filter, const Queued& velocity, double white) const;
  /// m/s, level: a velocity less the filter's, with the receiver's error in it.
  [[nodiscard]] Eigen::Vector2d off_way(const Filter& filter, const Queued& velocity) const;
  AidingRecord fuse(Filter& filter, const Queued& velocity, double gate) const;
  void watch(Filter& filter, const Queued& velocity, const Eigen::Vector2d& before);

  bool has_imu_, lasting_, timed_;
  Gates gates_;
  NoiseScale scale_;
  SmoothingTime smoothing_;
  LastingErrorModels models_{{0.5, 2.0, 8.0}, 0.9};  // s: filters of receivers, and multipath of a moving antenna
  int rejected_ = 0;
  int64_t last_us_ = 0;
};

}  // namespace roadfix::navigation
