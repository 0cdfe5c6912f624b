#include "navigation/aiding/camera/pose_history.h"

#include <algorithm>

#include "geometry/so3.h"

namespace roadfix::navigation {

namespace {

constexpr double kKept = 1.2;    // s: a late picture, the one before it, and the camera's offset
constexpr double kBeyond = 0.1;  // s, by which the newest sample may be older than a picture

}  // namespace

void PoseHistory::add(const ImuSample& imu, const Odometry* pose) {
  if (!poses_.empty() && imu.t_us <= poses_.back().t_us) return;
  Pose now;
  now.t_us = imu.t_us;
  now.rate = imu.gyro;
  if (pose != nullptr) {
    now.placed = true;
    now.T = pose->T_frame_vehicle;
    now.velocity = pose->velocity;
    now.rate = pose->angular_rate;
  } else if (!poses_.empty()) {
    now.T.q = (poses_.back().T.q * exp_q(seconds_between(poses_.back().t_us, imu.t_us) * imu.gyro)).normalized();
  }
  poses_.push_back(now);
  while (seconds_between(poses_.front().t_us, imu.t_us) > kKept || static_cast<int64_t>(poses_.size()) > kMost)
    poses_.pop_front();
}

std::optional<PoseHistory::Pose> PoseHistory::at(int64_t t_us) const {
  if (poses_.empty() || poses_.front().t_us > t_us || seconds_between(poses_.back().t_us, t_us) > kBeyond)
    return std::nullopt;
  const auto later = [](const Pose& p, int64_t t) { return p.t_us < t; };
  auto found = std::lower_bound(poses_.begin(), poses_.end(), t_us, later);
  if (found == poses_.end()) --found;
  Pose pose = *found;
  const double dt = seconds_between(pose.t_us, t_us);
  pose.T.p += dt * (pose.T.q * pose.velocity);
  pose.T.q = (pose.T.q * exp_q(dt * pose.rate)).normalized();
  return pose;
}

std::optional<CameraMotion> PoseHistory::motion(int64_t before_us, int64_t now_us, const SE3& T_imu_camera) const {
  const std::optional<Pose> before = at(before_us), now = at(now_us);
  if (!before || !now) return std::nullopt;
  if (before->placed != now->placed) return std::nullopt;
  const SE3 T = (now->T * T_imu_camera).inverse() * (before->T * T_imu_camera);
  CameraMotion motion;
  motion.R_now_before = T.R();
  if (now->placed) motion.p_now_before = T.p;
  return motion;
}

}  // namespace roadfix::navigation
