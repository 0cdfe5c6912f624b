/// Covariance of the camera's pose along the trajectory: what each adjustment adds, (S.9.1), and the common scale
/// errors, (S.10.1), (S.10.2). One for the tracker's own frame, one for that with all loops closed.
#pragma once

#include "geometry/se3.h"
#include "slam/considered_errors.h"
#include "slam/levelling.h"
#include "slam/velocity_prior.h"

namespace roadfix {

/// Errors of the map's scale.
struct ScaleErrors {
  ScaleSigmas sigmas;
  Eigen::Vector3d lever = Eigen::Vector3d::Zero();  ///< of the vehicle, camera axes, where the unit is not metric
};

class AccumulatedCovariance {
 public:
  /// At a pose given from outside. `keyframe`: of the last keyframe's camera.
  void start_at(const SE3& T_map_camera, const Matrix6d& keyframe);
  /// From the last keyframe to the next.
  void propagate(const SE3& T_map_keyframe, const SE3& T_keyframe_next);
  /// What the newest keyframe adds, and the variance of the logarithm of the scale.
  void add(const Matrix6d& keyframe, double scale_drift);
  /// Motion without images; `up`: the vehicle's z in camera axes.
  void add(const UnseenMotion& unseen, const Eigen::Vector3d& up);
  /// The scale is measured from here on.
  void reset_scale_drift() { considered_.reset_scale_drift(); }
  /// Levels the map, in which T_map_keyframe is the new pose of the last keyframe.
  void level(const LevellingRotation& levelling, const SE3& T_map_keyframe);

  /// Covariance of the camera's pose at an image, whose own is `image`; propagates the scale errors to there.
  [[nodiscard]] Matrix6d at_image(const SE3& T_map_keyframe, const SE3& T_keyframe_now, const SE3& T_map_now,
                                  const ScaleErrors& errors, const Matrix6d& image);
  /// Of the last keyframe, with the scale errors of the last image.
  [[nodiscard]] Matrix6d with_considered() const { return keyframe_ + considered_.cov(); }
  [[nodiscard]] const Matrix6d& keyframe() const { return keyframe_; }
  [[nodiscard]] const ConsideredErrors& considered() const { return considered_; }

  template <class Self, class Archive>
  static void members(Self& self, Archive& archive) {
    archive(self.keyframe_, self.considered_);
  }

 private:
  Matrix6d keyframe_ = Matrix6d::Zero();
  ConsideredErrors considered_;
};

}  // namespace roadfix
