// The visual frame's tie to ENU and requests to restart the vision (MODEL.md, sections 6 and 7).
#include "fusion/fusion.h"
#include "geometry/euler.h"

namespace roadfix {

using namespace fusion;

namespace {

constexpr double kTieSpacing = 1.0;  ///< s: the tie's comparisons are that far apart, for their errors' correlation
constexpr double kTieFloor = 0.02;   ///< m and rad / 10, of one comparison

}  // namespace

/// The tie follows the vision always, and learns from the fused pose while GNSS is there. One that went with its map
/// begins again at once, in an outage as well: as sure as the fused pose is, it can tell the vision where to restart.
void Fusion::update_tie(const ChannelSample& s) {
  const SE3& T_vo_vehicle = s.odometry.T_frame_vehicle;
  Eigen::Matrix4d cov = Eigen::Matrix4d::Zero();
  cov.topLeftCorner<2, 2>() = now_.planar.P.topLeftCorner<2, 2>();
  cov(2, 2) = height_variance_;
  cov(3, 3) = now_.planar.P(2, 2) + 0.01 * kTieFloor * kTieFloor;
  cov.diagonal().head<3>().array() += kTieFloor * kTieFloor;
  const bool known = placed_ && gnss_ && agreement_.agrees;
  if (!tie_.valid()) {
    if (!placed_) return;
    tie_.start(T_vo_vehicle, fused().T_frame_vehicle, cov, config_.tie);
    last_tie_us_ = t_us_;
    return;
  }
  tie_.move_to(T_vo_vehicle, config_.tie);
  if (!known || seconds_between(*last_tie_us_, t_us_) < kTieSpacing) return;
  tie_.correct(T_vo_vehicle, fused().T_frame_vehicle, cov);
  last_tie_us_ = t_us_;
}

/// Ock et al. (2020): vision starts again at the pose that the others agree on. Needs the tie, and somebody else who is alive.
void Fusion::ask_restart(const char* reason) {
  const bool others = alive(FusionChannel::kIns) || alive(FusionChannel::kWheel);
  const bool lately = restart_us_ && seconds_between(*restart_us_, t_us_) < config_.restart_every;
  if (!tie_.valid() || !others || lately) return;
  restart_reason_ = reason;
  restart_us_ = t_us_;
}

VisionRestart Fusion::take_restart(const Odometry& here) {
  VisionRestart r;
  r.T_vo_vehicle = tie_.to_vo(here.T_frame_vehicle);
  r.velocity = here.velocity;
  const Eigen::Matrix3d R_vo_enu = quaternion({-tie_.yaw(), 0.0, 0.0}).toRotationMatrix() / tie_.scale();
  r.cov_pose = here.cov_pose;
  r.cov_pose.topRows<3>() = (R_vo_enu * r.cov_pose.topRows<3>()).eval();
  r.cov_pose.leftCols<3>() = (r.cov_pose.leftCols<3>() * R_vo_enu.transpose()).eval();
  r.reason.swap(restart_reason_);
  return r;
}

}  // namespace roadfix
