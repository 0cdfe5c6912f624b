#include "slam/shared_error.h"

#include "geometry/so3.h"
#include "slam/pose_covariance.h"

namespace roadfix {

void SharedError::begin_at(const SE3& T_map_camera) {
  begun_ = true;
  T_map_camera_ = T_map_camera;
  columns_.setZero();
}

void SharedError::go_to(const SE3& T_map_camera, const SharedDoubt& doubt) {
  if (!begun_) return begin_at(T_map_camera);
  const SE3 T_before_now = T_map_camera_.inverse() * T_map_camera;
  columns_ = carried_by(T_map_camera_, T_before_now) * columns_;
  columns_.col(0).head<3>() += doubt.lengths * (T_map_camera.p - T_map_camera_.p);
  columns_.col(1).tail<3>() += doubt.turns * log_q(T_before_now.q);
  T_map_camera_ = T_map_camera;
}

void SharedError::move(const SE3& T_new_old) {
  T_map_camera_ = T_new_old * T_map_camera_;
  columns_.topRows<3>() = (T_new_old.R() * columns_.topRows<3>()).eval();
}

}  // namespace roadfix
