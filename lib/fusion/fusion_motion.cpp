// Motion since a channel's last sample (MODEL.md, section 4).
#include <algorithm>
#include <cmath>

#include "fusion/fusion_modes.h"

namespace roadfix {

using namespace fusion;

namespace {

constexpr double kScaleBase = 1.0;        ///< m, motion from which a non-metric scale is taken
constexpr double kFirstScaleSigma = 0.2;  ///< of that scale
constexpr double kCorrected = 0.01;       ///< share of a variance that an INS loses by a fix at least
constexpr double kStands = 0.5;           ///< share that is left of a velocity's variance once the car stands, at most
constexpr double kDistrustTime = 5.0;     ///< s, in which distrust of the INS velocity fades
constexpr double kYawTime = 1.0;          ///< s: over this time the yaws of two channels of one gyro are compared
constexpr int kOutliers = 3;              ///< in a row: vision itself has moved away

/// The INS has used a fix since its last sample: something of its pose became surer.
bool corrected(const LevelView& last, const LevelView& now) {
  return (now.P.diagonal().array() < (1.0 - kCorrected) * last.P.diagonal().array()).any();
}

/// A fix leaves a share of the error of the INS's velocity across the vehicle, which is its yaw's and the slip's; along
/// it starts anew (F.17). P: of the velocity, after the fix. `begun`: what the error has in common with it, likewise.
void leave_across(FusionEstimate& e, PoseBefore& begun, const Eigen::Matrix2d& P, const Eigen::Vector2d& across,
                  double share) {
  const Eigen::Vector2d along(across.y(), -across.x());
  const Eigen::Matrix2d A = share * across * across.transpose();
  const Eigen::Matrix2d own = A * e.P.block<2, 2>(kInsVelocity, kInsVelocity) * A;
  e.x.segment<2>(kInsVelocity) = (A * e.x.segment<2>(kInsVelocity)).eval();
  e.P.middleRows<2>(kInsVelocity) = A.lazyProduct(e.P.middleRows<2>(kInsVelocity)).eval();
  e.P.middleCols<2>(kInsVelocity) = e.P.middleRows<2>(kInsVelocity).transpose();
  e.P.block<2, 2>(kInsVelocity, kInsVelocity) = own + along.dot(P * along) * along * along.transpose() +
                                                (1.0 - share) * across.dot(P * across) * across * across.transpose();
  begun.with.middleRows<2>(kInsVelocity) = A.lazyProduct(begun.with.middleRows<2>(kInsVelocity)).eval();
}

}  // namespace

/// Motion since the last use. A filter's corrections of its past are none: its velocities tell the motion without them.
Planar Fusion::motion_of(FusionChannel channel, const LevelView& last, const LevelView& now) const {
  const bool filter = channel == FusionChannel::kIns || memory(channel).shares_imu;
  return filter ? motion_by_velocity(last, now).way : motion_between(last.pose, now.pose);
}

/// A vision without scale takes the first one from what the others say of the same motion.
bool Fusion::scale_is_open(const ChannelSample& s, const Planar& motion) {
  if (s.metric || !vo_scale_open_ || s.channel != FusionChannel::kVo) return false;
  const FusionEstimate now = combine(imm_);
  const double length = motion_between(now.x.segment<3>(kVoClone), now.x.segment<3>(kPos)).head<2>().norm();
  const double measured = motion.head<2>().norm();
  if (length < kScaleBase || !(measured > 0.0)) return true;
  for (Mode& mode : imm_.modes) set_independent(mode.estimate, kVoScale, std::log(measured / length), kFirstScaleSigma);
  vo_scale_open_ = false;
  return true;
}

/// What its turns share is nothing, or was, and is to be learnt from now on.
void Fusion::hear_of_turns(bool exact) {
  if (exact == vo_turns_exact_) return;
  vo_turns_exact_ = exact;
  for (Mode& mode : imm_.modes) set_independent(mode.estimate, kVoTurns, 0.0, exact ? 0.0 : config_.vo_turns_std);
}

/// Two channels that integrate the same gyro are not two witnesses of the yaw: the better one speaks.
bool Fusion::better_yaw_elsewhere(const ChannelSample& s, double variance) const {
  const FusionChannel other = s.channel == FusionChannel::kIns ? FusionChannel::kVo : FusionChannel::kIns;
  const bool shared = s.channel == FusionChannel::kIns ? memory(other).shares_imu : s.shares_imu;
  return shared && alive(other) && memory(other).last && agreement_.agrees &&
         memory(other).yaw_rate_variance < variance;
}

Eigen::Vector2d Fusion::grown_velocity_variance(const Eigen::Matrix2d& P) const {
  return (P - memory(FusionChannel::kIns).velocity_covariance).diagonal().cwiseMax(0.0);
}

/// The errors of the INS velocity and of its gyro last while no fix corrects them: their variances grow as the INS
/// says. Where the INS came to stand, or was away, what was known of them is void; where a fix did, all but what lasts
/// across the vehicle.
void Fusion::follow_ins_errors(const Odometry& ins, double dt, bool was_away) {
  Memory& m = memory(FusionChannel::kIns);
  const Eigen::Matrix2d P = horizontal_velocity_covariance(ins);
  const double drift_variance = ins_drift_std_ * ins_drift_std_;
  const bool anew = was_away || !foreign_ || P.trace() < kStands * m.velocity_covariance.trace();
  const bool redone = anew || ins_corrected_;
  const bool lasts = !anew && distrust_ * distrust_ < P.trace();
  const double yaw = now_.planar.pose.z();
  const Eigen::Vector2d across(-std::sin(yaw), std::cos(yaw));
  const double share = std::min(1.0, across.dot(P * across) / across.dot(m.velocity_covariance * across));
  const Eigen::Vector2d grown = grown_velocity_variance(P);
  const double drift_grown = std::max(0.0, drift_variance - m.drift_variance);
  distrust_ *= std::exp(-dt / kDistrustTime);
  for (std::size_t k = 0; k < kModes; ++k) {
    FusionEstimate& e = imm_.modes[k].estimate;
    if (!redone) {
      for (int i = 0; i < 2; ++i) e.P(kInsVelocity + i, kInsVelocity + i) += grown(i);
      e.P(kInsDrift, kInsDrift) += drift_grown;
      continue;
    }
    if (lasts) {
      leave_across(e, begun_[k], P, across, share);
    } else {
      for (int i = 0; i < 2; ++i) set_independent(e, kInsVelocity + i, 0.0, std::max(distrust_, std::sqrt(P(i, i))));
      begun_[k].with.middleRows<2>(kInsVelocity).setZero();
    }
    set_independent(e, kInsDrift, 0.0, ins_drift_std_);
    begun_[k].with.row(kInsDrift).setZero();
  }
  if (redone) {
    m.velocity_covariance = P;
    m.drift_variance = drift_variance;
    m.drifts_since_us = t_us_;
    return;
  }
  // The largest so far: what the wheels take off and the next steps add again is not new.
  m.velocity_covariance.diagonal() += grown;
  m.drift_variance += drift_grown;
}

/// Of its motion in the axes of its start: what the channel's covariance grew by, and the floor.
Eigen::Matrix3d Fusion::motion_noise(const Memory& m, const ChannelSample& s, const LevelView& view,
                                     const Planar& motion, double dt) const {
  const MotionFloor& f = floor(s.channel);
  const double way = motion.head<2>().norm();
  const Eigen::Vector3d sigma(f.position * std::sqrt(dt) + f.share * way, f.position * std::sqrt(dt) + f.across * way,
                              f.yaw * std::sqrt(dt));
  if (s.channel != FusionChannel::kIns) return motion_covariance(m.view.pose, m.view.P, motion, view.P, sigma);
  // Its positions' growth is that of the velocity's error, and some of its yaw's that of the gyro's: states here.
  const double lasting = 2.0 * m.drift_variance * seconds_between(m.drifts_since_us, t_us_) * dt;
  const double grown = view.P(2, 2) - m.view.P(2, 2) - lasting;
  Eigen::Vector3d variance = sigma.cwiseAbs2();
  variance.z() = std::max(variance.z(), grown);
  return variance.asDiagonal();
}

FuseStatus Fusion::fuse_motion(const ChannelSample& s, const LevelView& view, FusionChannelReport& report) {
  Memory& m = memory(s.channel);
  m.shares_imu = s.shares_imu;
  m.carried = false;
  if (m.reset_counter != s.reset_counter) {  // also after poses that were none: another map is another witness
    m.last.reset();
    if (s.channel == FusionChannel::kVo) {
      agreement_ = AgreementState{};
      vo_scale_open_ = true;
      tie_.forget();
    }
  }
  const bool ins = s.channel == FusionChannel::kIns;
  const double dt = m.last ? seconds_between(m.last->t_us, t_us_) : 0.0;
  if (ins ? dt >= timeout(s.channel) : dt > timeout(s.channel)) m.last.reset();  // the wheels may have the INS's clone
  if (ins && !m.last) {
    ins_corrected_ = false;
    follow_ins_errors(s.odometry, 0.0, true);
  }
  if (!m.last || dt <= 0.0) return FuseStatus::kNotReady;
  if (ins) ins_corrected_ = corrected(m.view, view);
  if (s.channel == FusionChannel::kVo) hear_of_turns(s.turns_exact);
  const Planar motion = motion_of(s.channel, m.view, view);
  if (scale_is_open(s, motion)) return FuseStatus::kNotReady;

  if (ins) follow_ins_errors(s.odometry, dt, false);
  Eigen::Matrix3d R = motion_noise(m, s, view, motion, dt);
  m.yaw_rate_variance = R(2, 2) / dt;
  if (ins) m.yaw_rate_variance += kYawTime * combined_variance(imm_, kInsDrift);
  if (better_yaw_elsewhere(s, m.yaw_rate_variance)) {
    R.row(2).setZero();
    R.col(2).setZero();
    R(2, 2) = kUninformative;
  }
  const bool with_yaw = R(2, 2) < kUninformative;
  return ins ? carry_by_ins(motion, dt, R, with_yaw, report) : fuse_odometry(s, motion, dt, R, with_yaw, report);
}

/// The place and the yaw are the INS's, carried on (F.11b).
FuseStatus Fusion::carry_by_ins(const Planar& motion, double dt, const Eigen::Matrix3d& R, bool with_yaw,
                                FusionChannelReport& report) {
  Mean<3> mean;
  for (std::size_t i = 0; i < kModes; ++i) {
    Mode& mode = imm_.modes[i];
    const CarriedOn told = mode.estimate.cloned ? carry_on(mode.estimate, motion, dt, R, with_yaw)
                                                : carry_on(mode.estimate, begun_[i], motion, dt, R, with_yaw);
    mode.log_likelihood += told.innovation.log_likelihood;
    add(mean, imm_.probability(static_cast<Eigen::Index>(i)), told.innovation, told.difference);
  }
  tell(mean.innovation, mean.difference, report);
  return FuseStatus::kAccepted;
}

/// An odometry's pose goes on beside the fused one, by its own motion (F.11c), and is compared with it: what its
/// pictures err by, each anew, does not add up (F.11d).
FuseStatus Fusion::fuse_odometry(const ChannelSample& s, const Planar& motion, double dt, const Eigen::Matrix3d& R,
                                 bool with_yaw, FusionChannelReport& report) {
  const FusionChannel channel = s.channel;
  Memory& m = memory(channel);
  const ChannelSlots where = slots(channel);
  const PlanarPassing off = passing(s);
  const Eigen::Matrix3d white = off.picture + off.map;
  const FusionEstimate now = combine(imm_);
  const Eigen::Matrix3d measured = R + white;
  if (channel == FusionChannel::kVo) {
    const FusionMeasurement<3> at = relative_motion(now.x, where, motion, dt, measured);
    tell(judge<3>(now, at.H, at.innovation, at.R), at.innovation, report);
    compare(agreement_, config_.agreement, report.nis);
    if (!agreement_.agrees) ask_restart("vision disagrees with wheels and imu");
    const bool outlier = report.nis > config_.gate;
    if (!agreement_.agrees || (outlier && agreement_.count >= kOutliers)) return FuseStatus::kGated;
    if (outlier) {
      for (Mode& mode : imm_.modes) carry_clone(mode.estimate, where, motion, dt, R);
      m.carried = true;
      return FuseStatus::kGated;
    }
  }
  foreign_ = true;
  if (!with_yaw) {
    const Mean<3> used = update<3>([&](const Vector& x) { return relative_motion(x, where, motion, dt, measured); });
    tell(used.innovation, used.difference, report);
    return FuseStatus::kAccepted;
  }
  for (Mode& mode : imm_.modes) carry_clone(mode.estimate, where, motion, dt, R);
  m.carried = true;
  const Eigen::Matrix3d lasting = in_frame(as_white(off, dt), now.x, where);
  const Mean<3> used = update<3>([&](const Vector& x) { return same_pose(x, where, lasting); });
  tell(used.innovation, used.difference, report);
  return FuseStatus::kAccepted;
}

}  // namespace roadfix
