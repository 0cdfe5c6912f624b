#include "slam/accumulated_covariance.h"

#include "slam/pose_covariance.h"

namespace roadfix {

void AccumulatedCovariance::start_at(const SE3& T_map_camera, const Matrix6d& keyframe) {
  considered_.start_at(T_map_camera);
  keyframe_ = keyframe;
}

void AccumulatedCovariance::propagate(const SE3& T_map_keyframe, const SE3& T_keyframe_next) {
  keyframe_ = transported(keyframe_, T_map_keyframe, T_keyframe_next);
}

void AccumulatedCovariance::add(const Matrix6d& keyframe, double scale_drift) {
  keyframe_ += keyframe;
  considered_.add_scale_drift(scale_drift);
}

void AccumulatedCovariance::add(const UnseenMotion& unseen, const Eigen::Vector3d& up) {
  const Eigen::Vector3d turn = unseen.turn * up;
  keyframe_.bottomRightCorner<3, 3>() += turn * turn.transpose();
  keyframe_.topLeftCorner<3, 3>().diagonal().array() += unseen.distance * unseen.distance;
}

void AccumulatedCovariance::level(const LevellingRotation& levelling, const SE3& T_map_keyframe) {
  keyframe_ = levelling.covariance(keyframe_, T_map_keyframe);
  considered_.move(levelling.transform());
}

Matrix6d AccumulatedCovariance::at_image(const SE3& T_map_keyframe, const SE3& T_keyframe_now, const SE3& T_map_now,
                                         const ScaleErrors& errors, const Matrix6d& image) {
  considered_.propagate_to(T_map_now, errors.sigmas, errors.lever);
  return transported(keyframe_, T_map_keyframe, T_keyframe_now) + image + considered_.cov();
}

}  // namespace roadfix
