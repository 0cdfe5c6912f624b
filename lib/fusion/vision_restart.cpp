#include "fusion/vision_restart.h"

#include <algorithm>

namespace roadfix {
namespace {

constexpr double kLeastSigma = 0.02;  ///< m, of a place at which the vision begins again
constexpr double kLeastTurn = 0.002;  ///< rad

}  // namespace

void VisionRestartRequest::tie(const SE3& T_vo_vehicle, const Odometry& local) {
  tied_ = true;
  T_vo_vehicle_ = T_vo_vehicle;
  T_local_vehicle_ = local.T_frame_vehicle;
  cov_local_ = local.cov_pose;
}

void VisionRestartRequest::ask(int64_t t_us, double every, const char* reason) {
  if (!tied_ || (asked_us_ && seconds_between(*asked_us_, t_us) < every)) return;
  reason_ = reason;
  asked_us_ = t_us;
}

VisionRestart VisionRestartRequest::take(const Odometry& local, double length) {
  SE3 motion = T_local_vehicle_.inverse() * local.T_frame_vehicle;
  motion.p /= length;
  VisionRestart r;
  r.T_vo_vehicle = T_vo_vehicle_ * motion;
  r.velocity = local.velocity / length;
  // What POSE_LOCAL has lost since, in the axes of the vision's frame: about the same in every direction of the plane.
  for (int i = 0; i < 6; ++i) {
    const double least = i < 3 ? kLeastSigma : kLeastTurn;
    r.cov_pose(i, i) = std::max(least * least, local.cov_pose(i, i) - cov_local_(i, i));
  }
  const double plane = std::max(r.cov_pose(0, 0), r.cov_pose(1, 1)) / (length * length);
  r.cov_pose(0, 0) = r.cov_pose(1, 1) = plane;
  r.cov_pose(2, 2) /= length * length;
  r.reason.swap(reason_);
  return r;
}

}  // namespace roadfix
