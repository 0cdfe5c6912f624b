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

int rank(Validity v) { return static_cast<int>(v); }

bool relies_on(const FusionNow& now, const std::optional<Lookahead::Ahead>& ahead) {
  if (!ahead || !ahead->valid) return false;
  return now.channel(ahead->channel).good(now.t_us) || now.local.leader() == ahead->channel;
}

/// Motion from `from` to now: by the lookahead as far as it is relied on.
MotionStep motion_to_now(const FusionNow& now, const CarriedPose& from, const std::optional<Lookahead::Ahead>& ahead) {
  if (!ahead) return now.local.motion(now.channels, from.t_us(), now.t_us);
  if (!relies_on(now, ahead)) return now.local.motion(now.channels, from.t_us(), ahead->newest.t_us);
  const PoseChannel& clock = now.channel(ahead->channel);
  const MotionStep here = now.local.motion(now.channels, from.t_us(), now.t_us);
  const MotionStep then = clock.corrected(ahead->motion, ahead->rise, ahead->dt);
  MotionSum sum;
  sum.add(here);
  sum.add(then);
  return {sum.motion, sum.Q, sum.by_calibration, sum.rise, sum.dt};
}

Odometry carried(const FusionNow& now, const CarriedPose& pose, const std::optional<Lookahead::Ahead>& ahead) {
  const MotionStep tail = motion_to_now(now, pose, ahead);
  const int64_t now_us = ahead ? ahead->newest.t_us : now.t_us;
  const MovedPlanar here = moved_by(pose.pose(), tail.motion);
  const Eigen::Matrix3d P = here.by_start * pose.covariance(now.channels) * here.by_start.transpose() +
                            here.by_motion * tail.Q * here.by_motion.transpose();
  Odometry attitude = now.local.attitude(now.channels, now_us);
  if (relies_on(now, ahead) && ahead->channel != FusionChannel::kVo) {
    const double length =
        ahead->channel == FusionChannel::kIns ? 1.0 : now.channel(ahead->channel).calibration().length();
    attitude.T_frame_vehicle.q = ahead->newest.T_frame_vehicle.q;
    attitude.velocity = length * ahead->newest.velocity;
    attitude.angular_rate = ahead->newest.angular_rate;
    attitude.cov_velocity = ahead->newest.cov_velocity;
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

FusedPoses PoseOutput::publish(const FusionNow& now, bool started, const Lookahead& lookahead) {
  FusedPoses out;
  const auto ahead = lookahead.from(now.t_us);
  if (!started) {
    out.report.reason = "waits for a pose";
    out.fused.t_us = out.local.t_us = lookahead.newest_us().value_or(now.t_us);
    return out;
  }
  out.local = carried(now, now.local.pose(), ahead);
  out.report = report(now);
  const PoseChannel& ins = now.channel(FusionChannel::kIns);
  const bool newest = now.failover.follows() && ahead && ahead->channel == FusionChannel::kIns && ahead->valid &&
                      !now.failover.implausible(ahead->correction, ins.view().P) && ahead->enu == now.failover.enu();
  if (newest)
    out.fused = ahead->newest;
  else if (now.failover.follows() && !ahead && ins.t_us() == now.t_us)
    out.fused = ins.odometry();
  else
    out.fused = carried(now, now.failover.pose(), ahead);
  // What the INS says of its newest pose counts at once, where it says worse.
  Validity validity = out.report.validity;
  if (newest && rank(ahead->newest.validity) < rank(validity)) validity = ahead->newest.validity;
  if (now.failover.follows() && ahead && !newest) validity = std::min(validity, Validity::kCoasting);
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
