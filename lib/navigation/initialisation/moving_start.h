/// A start in motion by camera and imu alone, in a local frame, (N.7.12) to (N.7.15) of MODEL.md: the last seconds are gone
/// through by iterated smoothing, until the speed has settled.
#pragma once

#include <deque>

#include "navigation/aiding/camera/camera_control.h"
#include "navigation/filter.h"

namespace roadfix::navigation {

class MovingStart {
 public:
  /// Before a start, every sample; those of the last seconds are kept, since the last gap.
  void add(const ImuSample& imu, double max_gap);
  void clear();

  struct Started {
    Filter filter;         ///< at the newest sample
    CameraControl camera;  ///< has used the pictures up to there
  };
  /// Once a second, if it succeeds. `camera`: the pictures of those seconds wait in it.
  [[nodiscard]] std::optional<Started> attempt(const NavigationConfig& config, const CameraControl& camera,
                                               const inertial::ImuNoise& noise);

  template <class Archive>
  void serialise(Archive& a) {
    a(tried_us_);
    serialise_list(a, imu_, kMostSamples, [&](ImuSample& s) { a(s.t_us, s.gyro, s.accel); });
  }

 private:
  static constexpr int64_t kMostSamples = 4096;  ///< 4 s at 1 kHz

  /// Where the seconds begin, imu axes, and the sensors' errors: what one pass finds for the next.
  struct Beginning {
    Eigen::Vector3d up = Eigen::Vector3d::UnitZ(), velocity = Eigen::Vector3d::Zero();
    Mean sensors;
  };
  [[nodiscard]] Beginning guess(const NavigationConfig& config) const;
  /// Linearised along the course that begins at `at`; `prior` is what is known before any measurement.
  [[nodiscard]] Started go_through(const NavigationConfig& config, const Beginning& prior, const Beginning& at,
                                   bool found, const CameraControl& camera, const inertial::ImuNoise& noise) const;
  [[nodiscard]] Beginning beginning_of(const Mean& end) const;

  std::deque<ImuSample> imu_;
  int64_t tried_us_ = 0;
};

}  // namespace roadfix::navigation
