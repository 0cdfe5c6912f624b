/// Moves means over imu samples and collects what that does to their errors, (N.2.1) and (N.2.2) of MODEL.md: for the filter
/// since its covariance's epoch, for the output from there to now.
#pragma once

#include "navigation/body_motion.h"
#include "navigation/state.h"
#include "samples/samples.h"

namespace roadfix::navigation {

class Propagation {
 public:
  explicit Propagation(const inertial::Earth& earth) : earth_(earth) {}

  /// Moves x over the `dt` s that end at imu.t_us.
  void move(Mean& x, const ImuSample& imu, double dt);
  /// The same, and its transition is part of the next transition().
  void add(Mean& x, const ImuSample& imu, double dt, const inertial::ImuNoise& noise);

  /// s since the epoch.
  [[nodiscard]] double duration() const { return sums_.duration(); }
  /// From the epoch to `now`, about p_ref; gravity: m/s2, level axes.
  [[nodiscard]] inertial::ErrorTransition transition(const inertial::Strapdown& now, const Eigen::Vector3d& p_ref,
                                                     const Eigen::Vector3d& gravity) const {
    return sums_.transition(now, p_ref, gravity, earth_.rate());
  }
  /// The epoch is now.
  void restart_sums() { sums_ = inertial::TransitionSums(); }
  /// The level axes become those of `earth`: turned by `turn`.
  void change_frame(const Eigen::Quaterniond& turn, const inertial::Earth& earth);

  [[nodiscard]] inertial::Earth& earth() { return earth_; }
  [[nodiscard]] const inertial::Earth& earth() const { return earth_; }
  [[nodiscard]] const BodyMotion& motion() const { return motion_; }
  [[nodiscard]] const inertial::InertialStep& last_step() const { return last_; }

  template <class Archive>
  void serialise(Archive& a) {
    earth_.serialise(a);
    sums_.serialise(a);
    last_.serialise(a);
    motion_.lag.serialise(a);
    a(motion_.rate, motion_.acceleration);
  }

 private:
  inertial::Earth earth_;
  inertial::TransitionSums sums_;
  inertial::InertialStep last_;
  BodyMotion motion_;
};

}  // namespace roadfix::navigation
