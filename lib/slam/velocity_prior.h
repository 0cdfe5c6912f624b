/// Prior of turns and displacements: the last motion continues (constant velocity), with the sigmas of what a vehicle
/// may do meanwhile. MODEL.md, sections 4 and 13.
#pragma once

#include <optional>

#include "geometry/se3.h"

namespace roadfix {

/// The camera's motion over the last frame.
struct FrameMotion {
  SE3 T_before_now;
  double dt_s = 0.0;

  template <class Self, class Archive>
  static void members(Self& self, Archive& archive) {
    archive(self.T_before_now, self.dt_s);
  }
};

/// Sigmas of a motion without images.
struct UnseenMotion {
  double distance = 0.0;  ///< m, along each axis
  double turn = 0.0;      ///< rad, about the vehicle's z
};

class VelocityPrior {
 public:
  void set(const std::optional<FrameMotion>& motion) { motion_ = motion; }
  /// From the vehicle's velocity in camera axes, m/s, without a turn.
  void set_velocity(const Eigen::Vector3d& velocity);
  void rescale(double factor);

  [[nodiscard]] bool known() const { return motion_ && motion_->dt_s > 0.0; }
  [[nodiscard]] const std::optional<FrameMotion>& motion() const { return motion_; }
  /// m/s; zero where unknown.
  [[nodiscard]] double speed() const { return known() ? motion_->T_before_now.p.norm() / motion_->dt_s : 0.0; }

  /// The pose `dt_s` after T_map_camera.
  [[nodiscard]] SE3 predict(const SE3& T_map_camera, double dt_s) const;
  /// Of a prediction, `unseen_s` after the last pose: rad, upper limit of the turn's error.
  [[nodiscard]] static double max_turn_error(double unseen_s);
  /// m/s, of each axis of the velocity.
  [[nodiscard]] double velocity_sigma(double unseen_s) const;
  /// Since the last pose, where nothing is predicted.
  [[nodiscard]] UnseenMotion since_loss(double unseen_s) const;
  /// Since a pose that is extrapolated with its `speed`, m/s.
  [[nodiscard]] static UnseenMotion since_pose(double speed, double dt_s);

  template <class Self, class Archive>
  static void members(Self& self, Archive& archive) {
    archive(self.motion_);
  }

 private:
  std::optional<FrameMotion> motion_;
};

}  // namespace roadfix
