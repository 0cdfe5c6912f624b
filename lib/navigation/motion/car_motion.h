/// The motion of a car that has no imu: what drives the state instead, (N.2.7) to (N.2.9) of MODEL.md.
///
/// A car keeps its speed and turns its velocity with itself. From wheel samples with a yaw rate, wheel speeds alone or
/// nothing but the stamps of fixes it makes samples that the filter takes as it takes an imu's: the yaw rate about the
/// vehicle's z axis, the centripetal acceleration, and no gravity (Earth::kinematic). What these do not measure is process
/// noise: changes of speed, of tilt and, without a yaw rate, of heading. Vehicle and imu axes are the same.
#pragma once

#include "inertial/earth.h"
#include "navigation/config.h"
#include "samples/samples.h"
#include "vehicle/axle_speed.h"

namespace roadfix::navigation {

/// The configuration of the same car for a filter without an imu.
NavigationConfig without_imu(NavigationConfig config);
/// What the level frame does to the motion: gravity and Earth rate at the anchor, or neither without an imu.
inertial::Earth earth_of(const NavigationConfig& config, const std::optional<Geodetic>& anchor);

class CarMotion {
 public:
  /// Longest sample that it makes.
  static constexpr double kStep = 0.05;  ///< s

  explicit CarMotion(const NavigationConfig& config) : config_(config) {}

  /// Calls take(ImuSample) for the steps from the newest sample to this one; false where the sample is none of a car
  /// or not newer.
  template <class Take>
  bool add(const WheelSample& wheels, const Take& take) {
    const std::optional<vehicle::AxleSpeed> axle = vehicle::axle_speed(wheels, config_.facts.wheels);
    if (!axle || wheels.t_us <= newest_us_) return false;
    see_wheels(wheels.t_us, *axle);
    steps_to(wheels.t_us, take);
    return true;
  }
  /// The same without wheels: time passes.
  template <class Take>
  bool pass(int64_t t_us, const Take& take) {
    if (t_us <= newest_us_) return false;
    see_nothing(t_us);
    steps_to(t_us, take);
    return true;
  }

  /// Densities over the sample that ends at t_us, at this speed, m/s.
  [[nodiscard]] inertial::ImuNoise noise(int64_t t_us, double speed) const;
  /// The wheels stand, and have for as long as `duration` s before t_us.
  [[nodiscard]] bool standing(int64_t t_us, double duration) const;
  /// Roll and pitch are to be tied to a level road now; counts it as done.
  bool level_due(int64_t t_us);
  /// rad, of that.
  [[nodiscard]] double level_std() const;
  /// The newest samples came from wheels.
  [[nodiscard]] bool driven_by_wheels() const { return by_wheels_; }

  template <class Archive>
  void serialise(Archive& a) {
    a(newest_us_, begun_us_, rate_, speed_, rate_before_, speed_before_, rate_sigma_, interval_, turning_from_us_,
      turning_until_us_, standing_since_us_, level_at_us_, by_wheels_);
  }

 private:
  void see_wheels(int64_t t_us, const vehicle::AxleSpeed& axle);
  void see_nothing(int64_t t_us);
  void begin_interval(int64_t t_us);
  [[nodiscard]] ImuSample sample(int64_t t_us, double share) const;
  [[nodiscard]] int steps() const;

  template <class Take>
  void steps_to(int64_t t_us, const Take& take) const {
    const int n = steps();
    const int64_t from = begun_us_ == 0 ? t_us : begun_us_;
    for (int i = 1; i <= n; ++i) take(sample(from + (t_us - from) * i / n, (i - 0.5) / n));
  }

  NavigationConfig config_;
  int64_t newest_us_ = 0, begun_us_ = 0;                // end and beginning of the newest interval
  double rate_ = 0.0, speed_ = 0.0;                     // rad/s, m/s, at its end
  double rate_before_ = 0.0, speed_before_ = 0.0;       // at its beginning
  double rate_sigma_ = 0.0, interval_ = 0.0;            // rad/s of each yaw rate; s between them
  int64_t turning_from_us_ = 0, turning_until_us_ = 0;  // the newest time without a yaw rate
  int64_t standing_since_us_ = 0;                       // zero: it does not stand
  int64_t level_at_us_ = 0;                             // last use of the level road
  bool by_wheels_ = false;
};

}  // namespace roadfix::navigation
