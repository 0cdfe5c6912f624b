/// Starts without GNSS, in a local frame: origin and heading are where the imu is then, gravity points down, (N.7.6) of
/// MODEL.md. Standing, or in motion with a speed from the wheels.
#pragma once

#include "navigation/aiding/camera/camera_control.h"
#include "navigation/initialisation/start.h"
#include "navigation/measurement_queue.h"

namespace roadfix::navigation {

/// The configuration of the same car for a filter that has no receiver, and needs not wait for one.
NavigationConfig without_gnss(NavigationConfig config);

/// What these strategies see besides the imu.
struct LocalContext {
  const NavigationConfig& config;
  int64_t t_us = 0;
  const inertial::StandstillDetector& standstill;
  std::optional<double> wheel_speed;     ///< m/s along the vehicle, just now, signed
  std::optional<double> flow_px;         ///< median motion of tracks over half a second
  double still_flow_px = 0.0;            ///< most of it while the camera stands
  [[nodiscard]] bool sees_rest() const;  ///< wheels or pictures say that it stands
  [[nodiscard]] bool sees_motion() const;
};

/// At rest: attitude from gravity, gyro biases from the mean, no velocity. Nothing but calm samples is not enough where
/// wheels or pictures say otherwise; where there are neither, calm for two seconds is.
std::optional<StartState> start_at_rest(const LocalContext& context);
/// Moving, speed known by the wheels: the axle does not slip; the mean specific force is gravity but for the turn's
/// lateral acceleration and what cars do along their way.
std::optional<StartState> start_with_speed(const LocalContext& context);

/// The newest wheel speed, for a start.
class LocalStart {
 public:
  void add(const Queued& wheels) {
    wheels_at_us_ = wheels.t_us;
    speed_ = wheels.value.x();
    has_sign_ = wheels.direction != WheelDirection::kUnknown;
  }
  /// Between the ends of blocks, now and then: pictures may show rest that the last block had.
  [[nodiscard]] bool due(int64_t t_us);
  /// The first strategy that can. `camera`: nothing without one. `fresh`: the block ends now; else rest alone is asked for.
  [[nodiscard]] std::optional<StartState> attempt(const NavigationConfig& config, int64_t t_us,
                                                  const inertial::StandstillDetector& standstill,
                                                  const CameraControl* camera, bool fresh) const;

  template <class Archive>
  void serialise(Archive& a) {
    a(wheels_at_us_, speed_, has_sign_, tried_us_);
  }

 private:
  int64_t wheels_at_us_ = 0, tried_us_ = 0;
  double speed_ = 0.0;
  bool has_sign_ = false;
};

}  // namespace roadfix::navigation
