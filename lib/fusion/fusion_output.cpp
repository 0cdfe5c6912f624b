// What the fusion publishes: poses for now, validity and reason (MODEL.md, section 7).
#include <algorithm>
#include <cmath>

#include "fusion/fusion.h"

namespace roadfix {
namespace {

const char* name_of(FusionChannel c) {
  if (c == FusionChannel::kIns) return "POSE_INS";
  return c == FusionChannel::kVo ? "POSE_VO" : "POSE_WHEEL";
}

int rank(Validity v) { return static_cast<int>(v); }

}  // namespace

bool Fusion::relies_on(const std::optional<Lookahead::Ahead>& ahead) const {
  if (!ahead || !ahead->valid) return false;
  return channel(ahead->channel).good(t_us_) || local_.leader() == ahead->channel;
}

MotionStep Fusion::motion_to_now(const CarriedPose& from, const std::optional<Lookahead::Ahead>& ahead) const {
  if (!ahead) return local_.motion(channels_, from.t_us(), t_us_);
  if (!relies_on(ahead)) return local_.motion(channels_, from.t_us(), ahead->newest.t_us);
  const PoseChannel& clock = channel(ahead->channel);
  const MotionStep here = local_.motion(channels_, from.t_us(), t_us_);
  const MotionStep then = clock.corrected(ahead->motion, ahead->rise, ahead->dt);
  MotionSum sum;
  sum.add(here);
  sum.add(then);
  return {sum.motion, sum.Q, sum.by_calibration, sum.rise, sum.dt};
}

Odometry Fusion::carried(const CarriedPose& pose, const std::optional<Lookahead::Ahead>& ahead) const {
  const MotionStep tail = motion_to_now(pose, ahead);
  const int64_t now_us = ahead ? ahead->newest.t_us : t_us_;
  const MovedPlanar here = moved_by(pose.pose(), tail.motion);
  const Eigen::Matrix3d P = here.by_start * pose.covariance(channels_) * here.by_start.transpose() +
                            here.by_motion * tail.Q * here.by_motion.transpose();
  Odometry attitude = local_.attitude(channels_, now_us);
  if (relies_on(ahead) && ahead->channel != FusionChannel::kVo) {
    const double length = ahead->channel == FusionChannel::kIns ? 1.0 : channel(ahead->channel).calibration().length();
    attitude.T_frame_vehicle.q = ahead->newest.T_frame_vehicle.q;
    attitude.velocity = length * ahead->newest.velocity;
    attitude.angular_rate = ahead->newest.angular_rate;
    attitude.cov_velocity = ahead->newest.cov_velocity;
  }
  return full_pose(now_us, here.pose, P, pose.height() + tail.rise, pose.height_variance() + tail.rise * tail.rise,
                   attitude);
}

Planar Fusion::local_planar(int64_t t_us) const {
  const CarriedPose& pose = local_.pose();
  if (t_us >= pose.t_us()) return after_motion(pose.pose(), local_.motion(channels_, pose.t_us(), t_us).motion);
  // Back from there: the motion from t_us to the pose, the other way round.
  const Planar on = local_.motion(channels_, t_us, pose.t_us()).motion;
  return after_motion(pose.pose(), motion_between(on, Planar::Zero()));
}

/// POSE_LOCAL at a time before t_us() as well.
Odometry Fusion::local_at(int64_t t_us) const {
  Odometry attitude = local_.attitude(channels_, t_us);
  const CarriedPose& pose = local_.pose();
  return full_pose(t_us, local_planar(t_us), pose.covariance(channels_), pose.height(), pose.height_variance(),
                   attitude);
}

ChannelSample Fusion::at_present(ChannelSample sample) const {
  Odometry& o = sample.odometry;
  if (!started_ || o.t_us >= t_us_) return sample;
  const Planar motion = motion_between(local_planar(o.t_us), local_planar(t_us_));
  o.T_frame_vehicle = o.T_frame_vehicle * SE3{quaternion({motion.z(), 0.0, 0.0}), {motion.x(), motion.y(), 0.0}};
  o.t_us = t_us_;
  return sample;
}

FusedPoses Fusion::publish(const Lookahead& lookahead) {
  FusedPoses out;
  const auto ahead = lookahead.from(t_us_);
  if (!started_) {
    out.report.reason = "waits for a pose";
    out.fused.t_us = out.local.t_us = lookahead.newest_us().value_or(t_us_);
    return out;
  }
  out.local = carried(local_.pose(), ahead);
  out.report = report();
  const PoseChannel& ins = channel(FusionChannel::kIns);
  const bool newest = failover_.follows() && ahead && ahead->channel == FusionChannel::kIns && ahead->valid &&
                      !failover_.implausible(ahead->correction, ins.view().P) && ahead->enu == failover_.enu();
  if (newest)
    out.fused = ahead->newest;
  else if (failover_.follows() && !ahead && ins.t_us() == t_us_)
    out.fused = ins.odometry();
  else
    out.fused = carried(failover_.pose(), ahead);
  // What the INS says of its newest pose counts at once, where it says worse.
  Validity now = out.report.validity;
  if (newest && rank(ahead->newest.validity) < rank(now)) now = ahead->newest.validity;
  if (failover_.follows() && ahead && !newest) now = std::min(now, Validity::kCoasting);
  out.report.validity = now;
  if (now != Validity::kValid && out.report.phase == FusionPhase::kRunning) out.report.phase = FusionPhase::kWeak;
  out.fused.validity = now;
  out.local.validity = out.report.local_validity;
  jumps_.add(out.fused, out.local, failover_.enu(), config_.announced);
  out.report.reset_counter = jumps_.count();
  out.report.last_jump = jumps_.last();
  out.report.last_jump_height = jumps_.last_height();
  return out;
}

Validity Fusion::validity_now() const {
  if (failover_.follows()) return channel(FusionChannel::kIns).odometry().validity;
  const double sigma = std::sqrt(failover_.pose().covariance(channels_).topLeftCorner<2, 2>().trace());
  if (!local_.leader() && local_.unled(t_us_) > config_.unled) return Validity::kInvalid;
  if (sigma > config_.lost_sigma && failover_.enu()) return Validity::kInvalid;
  return Validity::kCoasting;  // in a local frame as well: where on the map it is, nobody knows
}

/// A worse validity counts at once, a better one when it has held for a while.
void Fusion::settle_validity(double dt) {
  const Validity now = validity_now();
  if (rank(now) <= rank(validity_)) {
    validity_ = now;
    better_for_ = 0.0;
    return;
  }
  if (validity_ == Validity::kInvalid) validity_ = Validity::kCoasting;
  better_for_ += dt;
  if (better_for_ >= config_.valid_after) validity_ = now;
}

FusionReport Fusion::report() const {
  FusionReport r;
  r.enu = failover_.enu();
  r.follows_ins = failover_.follows();
  r.leader = local_.leader();
  r.validity = validity_;
  r.reason = reason();
  const double unled = local_.leader() ? 0.0 : local_.unled(t_us_);
  r.local_validity = local_.leader() ? Validity::kValid : Validity::kCoasting;
  if (unled > config_.unled) r.local_validity = Validity::kInvalid;
  r.phase = FusionPhase::kRunning;
  if (r.validity != Validity::kValid || !r.enu) r.phase = FusionPhase::kWeak;
  if (r.validity == Validity::kInvalid) r.phase = FusionPhase::kLost;
  return r;
}

std::string Fusion::reason() const {
  std::string text;
  const auto say = [&](const std::string& words) { text += (text.empty() ? "" : "; ") + words; };
  const auto leader = local_.leader();
  if (!failover_.enu()) say("no absolute pose yet: local frame");
  if (failover_.follows()) {
    if (failover_.enu() && !failover_.gnss()) say("no GNSS");
  } else {
    if (!failover_.why().empty()) say(failover_.why());
    if (failover_.enu() || !leader)
      say(leader ? std::string("carried by ") + name_of(*leader) : "no channel is relied on");
  }
  for (const FusionChannel c : {FusionChannel::kVo, FusionChannel::kWheel})
    if (channel(c).state(t_us_) == ChannelState::kContradicted) say(std::string(name_of(c)) + " contradicts");
  return text;
}

}  // namespace roadfix
