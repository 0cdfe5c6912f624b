#include "fusion/failover.h"

#include <algorithm>
#include <cmath>

namespace roadfix {
namespace {

constexpr double kPlaceFloor = 0.1;  ///< m, of a comparison of two poses
constexpr double kYawFloor = 0.005;  ///< rad
constexpr double kGate2 = 13.8;      ///< squared Mahalanobis distance, 99.9 % of 2 degrees of freedom
constexpr double kFixes = 1.0;       ///< s of fixes after which an INS that came back is right
constexpr int kTrustSpacing = 10;    ///< epochs between poses that are kept to go back to: 5 s
constexpr double kOldTrust = 1.0;    ///< s: a pose that no witness carried since is none to go back to

const PoseChannel& ins_of(const Channels& channels) { return channels[0]; }

Eigen::Matrix3d floor_of_poses() {
  return Eigen::Vector3d(kPlaceFloor * kPlaceFloor, kPlaceFloor * kPlaceFloor, kYawFloor * kYawFloor).asDiagonal();
}

void start_at(CarriedPose& pose, const PoseChannel& ins) {
  pose.start(ins.t_us(), ins.view().pose, ins.view().P, ins.odometry().T_frame_vehicle.p.z(),
             ins.odometry().cov_pose(2, 2));
}

}  // namespace

void Failover::set_gnss(int64_t t_us, bool present) {
  if (present && !gnss_) gnss_since_us_ = t_us;
  gnss_ = present;
}

bool Failover::implausible(const Planar& correction, const Eigen::Matrix3d& P) const {
  const Eigen::Vector2d d = correction.head<2>();
  if (gnss_ || d.norm() < config_.jump) return false;
  const Eigen::Matrix2d S = P.topLeftCorner<2, 2>() + kPlaceFloor * kPlaceFloor * Eigen::Matrix2d::Identity();
  return d.dot(S.ldlt().solve(d)) > kGate2;
}

void Failover::add(FusionChannel c, bool fresh, const Channels& channels, const LocalMotion& local, int64_t t_us) {
  const PoseChannel& ins = ins_of(channels);
  const ChannelState state = ins.state(t_us);
  if (state == ChannelState::kGood) {
    if (!good_since_us_) good_since_us_ = t_us;
  } else {
    good_since_us_.reset();
  }
  if (follows_ && state == ChannelState::kSilent) stop("POSE_INS is silent");
  if (follows_ && state == ChannelState::kInvalid) stop("POSE_INS is invalid");
  if (follows_ && state == ChannelState::kFrozen) {
    if (witness_ && seconds_between(trusted_[0].t_us(), t_us) < kOldTrust) pose_ = trusted_[0];
    stop("POSE_INS is frozen");
  }
  carry(c, fresh, channels, local, t_us);
  if (c != FusionChannel::kIns || state != ChannelState::kGood || !fresh) return;
  if (!follows_) {
    if (readmits(ins, channels, local, t_us)) take_over(ins);
    return;
  }
  if (implausible(ins.correction(), ins.covariance_before())) return stop("POSE_INS corrected itself without a fix");
  enu_ = enu_ || ins.newest().enu;
  start_at(pose_, ins);
}

void Failover::carry(FusionChannel c, bool fresh, const Channels& channels, const LocalMotion& local, int64_t t_us) {
  if (!follows_) {
    // In step with POSE_LOCAL, whatever led it there.
    if (fresh && c == local.leader()) {
      pose_.carry(c, channels);
    } else if (local.pose().t_us() > pose_.t_us()) {
      pose_.carry(local.pose().t_us(), local.motion(channels, pose_.t_us(), local.pose().t_us()), channels);
    }
  }
  witness_ = local.witness(channels, t_us);
  if (fresh && witness_ == c)
    for (CarriedPose& pose : trusted_) pose.carry(c, channels);
}

void Failover::stop(const char* why) {
  follows_ = false;
  why_ = why;
}

/// An INS that is healthy again is followed where it agrees with the carried pose, or where fixes have aided it for long
/// enough: after a contradiction longer than after a mere silence.
bool Failover::readmits(const PoseChannel& ins, const Channels& channels, const LocalMotion& local,
                        int64_t t_us) const {
  if (!ever_ || (ins.newest().enu && !enu_)) return true;
  if (ins.newest().enu != enu_) return false;
  const double healthy = seconds_between(*good_since_us_, t_us);
  if (healthy < config_.readmission) return false;
  const double aided = std::min(healthy, gnss_for(t_us));
  if (aided >= (contradicted_ ? config_.refusal_timeout : kFixes)) return true;
  const MotionStep tail = local.motion(channels, pose_.t_us(), t_us);
  const MovedPlanar here = moved_by(pose_.pose(), tail.motion);
  const Eigen::Matrix3d S =
      moved_covariance(here, pose_.covariance(channels), tail.Q) + ins.view().P + floor_of_poses();
  const Planar d = difference_of(ins.view().pose, here.pose);
  return d.dot(S.ldlt().solve(d)) < config_.agreement.gate;
}

void Failover::take_over(const PoseChannel& ins) {
  follows_ = ever_ = true;
  contradicted_ = false;
  enu_ = ins.newest().enu;
  why_.clear();
  start_at(pose_, ins);
  trusted_ = {pose_, pose_};
  epochs_ = 0;
}

void Failover::judge(bool condemned, bool clear, const Channels& channels, int64_t t_us) {
  if (condemned) contradicted_ = ever_;
  if (follows_ && condemned) {
    if (seconds_between(trusted_[0].t_us(), t_us) < kOldTrust) pose_ = trusted_[0];
    stop("POSE_INS contradicts POSE_VO and POSE_WHEEL");
  }
  const PoseChannel& ins = ins_of(channels);
  if (!follows_ || !clear || ++epochs_ < kTrustSpacing || !ins.alive(t_us)) return;
  epochs_ = 0;
  trusted_[0] = trusted_[1];
  start_at(trusted_[1], ins);
}

}  // namespace roadfix
