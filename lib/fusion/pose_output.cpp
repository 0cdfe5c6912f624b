#include "fusion/pose_output.h"

#include <algorithm>
#include <cmath>

namespace roadfix {

using namespace fusion;

namespace {

const char* name_of(FusionChannel c) {
  if (c == FusionChannel::kIns) return "POSE_INS";
  return c == FusionChannel::kVo ? "POSE_VO" : "POSE_WHEEL";
}

constexpr double kLongestGap = 0.3;  ///< s, over which velocities are the motion

int rank(Validity v) { return static_cast<int>(v); }

/// What is ahead of the horizon: the clock's newest sample, and the motion by its channel's velocities from there.
struct Ahead {
  const Odometry* newest = nullptr;  ///< none: nothing is ahead
  FusionChannel channel = FusionChannel::kIns;
  bool joined = false;  ///< to what the fusion has taken in of its channel
  bool enu = false;
  double dt = 0.0, rise = 0.0;
  Planar motion = Planar::Zero();
  Planar correction = Planar::Zero();  ///< by which the newest pose is not where the velocities lead
};

Ahead ahead_of(const FusionNow& now, const NewestSample& n) {
  Ahead a;
  if (!n.sample || n.sample->odometry.t_us <= now.t_us) return a;
  a.newest = &n.sample->odometry;
  a.channel = n.sample->channel;
  a.enu = n.sample->enu;
  a.dt = seconds_between(now.t_us, a.newest->t_us);
  const PoseChannel& clock = now.channel(a.channel);
  a.joined = clock.alive(now.t_us) && clock.newest().reset_counter == n.sample->reset_counter &&
             (!n.invalid_us || *n.invalid_us <= clock.t_us()) &&
             seconds_between(clock.t_us(), a.newest->t_us) < kLongestGap;
  if (!a.joined) return a;
  const LevelView view = level_view(*a.newest);
  const VelocityMotion whole = motion_by_velocity(clock.view(), view);
  const double known = seconds_between(clock.t_us(), now.t_us);
  a.motion = motion_between(motion_ahead(clock.view(), known), whole.way);
  a.rise = whole.rise - known * clock.view().velocity.z();
  a.correction = difference_of(view.pose, after_motion(clock.view().pose, whole.way));
  return a;
}

/// A pose of the horizon, carried on to now: by what is ahead as far as that is relied on.
Odometry carried(const FusionNow& now, const CarriedPose& pose, const Ahead& ahead) {
  const int64_t now_us = ahead.newest ? ahead.newest->t_us : now.t_us;
  const bool relied = ahead.newest != nullptr && ahead.joined &&
                      (now.channel(ahead.channel).good(now.t_us) || now.local.leader() == ahead.channel);
  MotionStep tail;
  tail.add(now.local.motion(now.channels, pose.t_us(), relied ? now.t_us : now_us));
  if (relied) tail.add(now.channel(ahead.channel).corrected(ahead.motion, ahead.rise, ahead.dt));
  const MovedPlanar here = moved_by(pose.pose(), tail.motion);
  const Eigen::Matrix3d P = moved_covariance(here, pose.covariance(now.channels), tail.Q);
  Odometry attitude = now.local.attitude(now.channels, now_us);
  if (relied && ahead.channel != FusionChannel::kVo) {
    const double length =
        ahead.channel == FusionChannel::kIns ? 1.0 : now.channel(ahead.channel).calibration().length();
    attitude.T_frame_vehicle.q = ahead.newest->T_frame_vehicle.q;
    attitude.velocity = length * ahead.newest->velocity;
    attitude.angular_rate = ahead.newest->angular_rate;
    attitude.cov_velocity = ahead.newest->cov_velocity;
  }
  return full_pose(now_us, here.pose, P, pose.height() + tail.rise, pose.height_variance() + tail.rise * tail.rise,
                   attitude);
}

Validity validity_of(const FusionNow& now) {
  if (now.failover.follows()) return now.channel(FusionChannel::kIns).odometry().validity;
  const double sigma = std::sqrt(now.failover.pose().covariance(now.channels).topLeftCorner<2, 2>().trace());
  if (!now.local.leader() && now.local.unled(now.t_us) > now.config.unled) return Validity::kInvalid;
  if (sigma > now.config.lost_sigma && now.failover.enu()) return Validity::kInvalid;
  return Validity::kCoasting;  // in a local frame as well: where on the map it is, nobody knows
}

}  // namespace

FusedPoses PoseOutput::publish(const FusionNow& now, bool started, const NewestSample& newest) {
  FusedPoses out;
  if (!started) {
    out.report.reason = "waits for a pose";
    out.fused.t_us = out.local.t_us = newest.sample ? newest.sample->odometry.t_us : now.t_us;
    return out;
  }
  const Ahead ahead = ahead_of(now, newest);
  out.local = carried(now, now.local.pose(), ahead);
  out.report = report(now);
  const PoseChannel& ins = now.channel(FusionChannel::kIns);
  const bool follows = now.failover.follows();
  const bool by_newest = follows && ahead.joined && ahead.channel == FusionChannel::kIns &&
                         ahead.enu == now.failover.enu() && !now.failover.implausible(ahead.correction, ins.view().P);
  if (by_newest)
    out.fused = *ahead.newest;
  else if (follows && !ahead.newest && ins.t_us() == now.t_us)
    out.fused = ins.odometry();
  else
    out.fused = carried(now, now.failover.pose(), ahead);
  // What the INS says of its newest pose counts at once, where it says worse.
  Validity validity = out.report.validity;
  if (by_newest) validity = std::min(validity, ahead.newest->validity);
  if (follows && ahead.newest && !by_newest) validity = std::min(validity, Validity::kCoasting);
  out.report.validity = validity;
  if (validity != Validity::kValid && out.report.phase == FusionPhase::kRunning) out.report.phase = FusionPhase::kWeak;
  out.fused.validity = validity;
  out.local.validity = out.report.local_validity;
  jumps_.add(out.fused, out.local, now.failover.enu(), now.config.announced);
  out.report.reset_counter = jumps_.count();
  out.report.last_jump = jumps_.last();
  out.report.last_jump_height = jumps_.last_height();
  return out;
}

void PoseOutput::settle(const FusionNow& now, double dt) {
  const Validity newest = validity_of(now);
  if (rank(newest) <= rank(validity_)) {
    validity_ = newest;
    better_for_ = 0.0;
    return;
  }
  if (validity_ == Validity::kInvalid) validity_ = Validity::kCoasting;
  better_for_ += dt;
  if (better_for_ >= now.config.valid_after) validity_ = newest;
}

FusionReport PoseOutput::report(const FusionNow& now) const {
  FusionReport r;
  r.enu = now.failover.enu();
  r.follows_ins = now.failover.follows();
  r.leader = now.local.leader();
  r.validity = validity_;
  r.reason = reason(now);
  const double unled = now.local.leader() ? 0.0 : now.local.unled(now.t_us);
  r.local_validity = now.local.leader() ? Validity::kValid : Validity::kCoasting;
  if (unled > now.config.unled) r.local_validity = Validity::kInvalid;
  r.phase = FusionPhase::kRunning;
  if (r.validity != Validity::kValid || !r.enu) r.phase = FusionPhase::kWeak;
  if (r.validity == Validity::kInvalid) r.phase = FusionPhase::kLost;
  return r;
}

std::string PoseOutput::reason(const FusionNow& now) {
  std::string text;
  const auto say = [&](const std::string& words) { text += (text.empty() ? "" : "; ") + words; };
  const auto leader = now.local.leader();
  if (!now.failover.enu()) say("no absolute pose yet: local frame");
  if (now.failover.follows()) {
    if (now.failover.enu() && !now.failover.gnss()) say("no GNSS");
  } else {
    if (!now.failover.why().empty()) say(now.failover.why());
    if (now.failover.enu() || !leader)
      say(leader ? std::string("carried by ") + name_of(*leader) : "no channel is relied on");
  }
  for (const FusionChannel c : {FusionChannel::kVo, FusionChannel::kWheel})
    if (now.channel(c).state(now.t_us) == ChannelState::kContradicted) say(std::string(name_of(c)) + " contradicts");
  return text;
}

}  // namespace roadfix
