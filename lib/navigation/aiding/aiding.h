/// The aiding sources of one filter and the table that lists them: what is queued goes to the source of its kind, and
/// what keeps its own time (constraint, standstill, pictures) is used at imu epochs.
#pragma once

#include "navigation/aiding/aiding_log.h"
#include "navigation/aiding/camera/camera_control.h"
#include "navigation/aiding/gnss_position/gnss_position_control.h"
#include "navigation/aiding/gnss_velocity/gnss_velocity_control.h"
#include "navigation/aiding/nonholonomic/nonholonomic_control.h"
#include "navigation/aiding/prior_pose/prior_pose_control.h"
#include "navigation/aiding/wheel_speed/wheel_speed_control.h"
#include "navigation/aiding/zero_motion/zero_motion_control.h"
#include "navigation/motion/motion_input.h"

namespace roadfix::navigation {

class Aiding {
 public:
  explicit Aiding(const NavigationConfig& config);

  /// What a source makes of a queued measurement; `trial`: for a hypothesis of the start, no gate and no learning.
  AidingRecord use(Filter& filter, const Queued& q);
  AidingRecord try_on(Filter& filter, const Queued& q) const;
  [[nodiscard]] static AidingSource source_of(Queued::Kind kind);

  /// The constraint, where it is due at the filter's epoch; `wheels`: a wheel speed has just come.
  void constrain(Filter& filter, bool wheels, AidingLog& log);
  /// At the end of a block.
  [[nodiscard]] bool standing(const Filter& filter, const MotionInput& motion) const;
  /// What was taken up to the filter's epoch.
  void use_pictures(Filter& filter, const MotionInput& motion, AidingLog& log);
  /// A step that explains the innovations is taken back, (N.5.10); true: one was.
  bool mend_step(Filter& filter, bool frozen);

  [[nodiscard]] NonholonomicControl& nonholonomic() { return nonholonomic_; }
  [[nodiscard]] const ZeroMotionControl& zero_motion() const { return zero_motion_; }
  [[nodiscard]] GnssPositionControl& gnss_position() { return gnss_position_; }
  [[nodiscard]] const GnssPositionControl& gnss_position() const { return gnss_position_; }
  [[nodiscard]] PriorPoseControl& prior_pose() { return prior_pose_; }
  [[nodiscard]] const PriorPoseControl& prior_pose() const { return prior_pose_; }
  /// Null where no camera is used.
  [[nodiscard]] CameraControl* camera() { return camera_ ? &*camera_ : nullptr; }
  [[nodiscard]] const CameraControl* camera() const { return camera_ ? &*camera_ : nullptr; }
  /// Wheel speeds have come.
  [[nodiscard]] bool with_wheels() const { return nonholonomic_.with_wheels(); }
  /// Steps of their scale that were detected and taken back.
  [[nodiscard]] int64_t wheel_scale_steps() const { return wheel_steps_ + wheel_speed_.scale_steps(); }
  /// The antenna is not where the calibration says.
  [[nodiscard]] bool arm_contradicted() const { return arm_contradicted_; }

  template <class Archive>
  void serialise(Archive& a) {
    gnss_position_.serialise(a);
    gnss_velocity_.serialise(a);
    wheel_speed_.serialise(a);
    nonholonomic_.serialise(a);
    prior_pose_.serialise(a);
    if (camera_) camera_->serialise(a);
    a(wheel_steps_, arm_contradicted_);
  }

 private:
  AidingRecord heading(Filter& filter, const Queued& q, double gate) const;
  AidingRecord magnetic(Filter& filter, const Queued& q, double gate) const;
  [[nodiscard]] bool picture_still(const Mean& x) const;

  NavigationConfig config_;
  Gates gates_;
  GnssPositionControl gnss_position_;
  GnssVelocityControl gnss_velocity_;
  WheelSpeedControl wheel_speed_;
  NonholonomicControl nonholonomic_;
  ZeroMotionControl zero_motion_;
  PriorPoseControl prior_pose_;
  std::optional<CameraControl> camera_;  ///< where there is one that is to be used
  int64_t wheel_steps_ = 0;
  bool arm_contradicted_ = false;
};

}  // namespace roadfix::navigation
