#include "fusion/local_motion.h"

#include <algorithm>

namespace roadfix {

using namespace fusion;

namespace {

constexpr double kStartSigma = 1e-3;        ///< m and rad: a local frame begins where it begins
constexpr double kInsAdvantage = 4.0;       ///< of variances: an INS has the other channels' sensors as well
constexpr double kStay = 0.8;               ///< another channel leads where its expected error is less than this share
constexpr double kLongestPrediction = 1.0;  ///< s, for which an acceleration lasts
constexpr double kPlaceSigma = 0.05;        ///< m, of POSE_LOCAL as the IMM sees it
constexpr double kYawSigma = 0.005;         ///< rad

std::size_t index_of(FusionChannel c) { return static_cast<std::size_t>(c); }

}  // namespace

void LocalMotion::start(int64_t t_us) {
  pose_.start(t_us, Planar::Zero(), kStartSigma * kStartSigma * Eigen::Matrix3d::Identity(), 0.0,
              kStartSigma * kStartSigma);
  for (Mode& mode : imm_.modes) mode.estimate.P.diagonal() << 1e-4, 1e-4, 1e-6, 2500.0, 4.0, 0.01;
  combined_ = combine(imm_);
  imm_us_ = led_us_ = t_us;
}

std::optional<FusionChannel> LocalMotion::choose(const Channels& channels, int64_t t_us, bool with_ins,
                                                 std::optional<FusionChannel> now) const {
  // A channel on trial leads only where no other does.
  for (const ChannelState least : {ChannelState::kGood, ChannelState::kOnTrial}) {
    std::optional<FusionChannel> best;
    double best_error = 0.0;
    for (const FusionChannel c : {FusionChannel::kIns, FusionChannel::kVo, FusionChannel::kWheel}) {
      const PoseChannel& channel = channels[index_of(c)];
      if ((c == FusionChannel::kIns && !with_ins) || channel.state(t_us) != least || !channel.has_lengths()) continue;
      double error = channel.expected_error(combined_.x(kSpeed));
      if (c == FusionChannel::kIns) error /= kInsAdvantage;
      if (c == now) error *= kStay;
      if (best && error >= best_error) continue;
      best = c;
      best_error = error;
    }
    if (best) return best;
  }
  return std::nullopt;
}

std::optional<FusionChannel> LocalMotion::witness(const Channels& channels, int64_t t_us) const {
  const auto now = leader_ == FusionChannel::kIns ? std::nullopt : leader_;
  return choose(channels, t_us, false, now);
}

void LocalMotion::add(FusionChannel c, bool fresh, const Channels& channels, int64_t t_us) {
  const auto best = choose(channels, t_us, true, leader_);
  if (best != leader_) {
    if (velocity_ && channels[index_of(*velocity_)].alive(t_us))
      pose_.carry(t_us, motion(channels, pose_.t_us(), t_us), channels);
    leader_ = best;
  }
  // An INS's velocity is the best, then the wheels'. Where nobody leads, the last one goes on.
  if (leader_) velocity_ = leader_;
  for (const FusionChannel v : {FusionChannel::kWheel, FusionChannel::kIns})
    if (channels[index_of(v)].good(t_us)) velocity_ = v;
  if (!fresh) return;
  if (c == leader_) {
    pose_.carry(c, channels);
    led_us_ = t_us;
    if (leader_ != FusionChannel::kIns || channels[index_of(c)].good(t_us))
      attitude_ = channels[index_of(c)].odometry();
  }
  if (c == velocity_) update_modes(channels);
}

void LocalMotion::update_modes(const Channels& channels) {
  const PoseChannel& channel = channels[index_of(*velocity_)];
  const int64_t t_us = channel.t_us();
  if (t_us < imm_us_) return;
  advance(imm_, config_.durations, config_.motion, seconds_between(imm_us_, t_us));
  imm_us_ = t_us;
  const Planar here = after_motion(pose_.pose(), motion(channels, pose_.t_us(), t_us).motion);
  update_pose(
      imm_, here,
      Eigen::Vector3d(kPlaceSigma * kPlaceSigma, kPlaceSigma * kPlaceSigma, kYawSigma * kYawSigma).asDiagonal());
  update_component(imm_, kSpeed, channel.speed(), config_.speed_sigma * config_.speed_sigma);
  update_component(imm_, kTurn, channel.view().turn, config_.turn_sigma * config_.turn_sigma);
  reweigh(imm_);
  combined_ = combine(imm_);
}

MotionStep LocalMotion::motion(const Channels& channels, int64_t from_us, int64_t to_us) const {
  const double dt = seconds_between(from_us, to_us);
  if (dt == 0.0) return {};
  if (velocity_ && channels[index_of(*velocity_)].last_us()) {
    const PoseChannel& channel = channels[index_of(*velocity_)];
    if (channel.track().has(from_us) && from_us < channel.t_us()) {
      const int64_t known_us = std::min(to_us, channel.t_us());
      MotionStep sum;
      sum.add(channel.measured(from_us, known_us));
      if (known_us < to_us) sum.add(motion(channels, known_us, to_us));
      return sum;
    }
    const double middle = seconds_between(channel.t_us(), from_us) + 0.5 * dt;
    const double lasts = std::clamp(middle, -kLongestPrediction, kLongestPrediction);
    return channel.by_velocity(dt, combined_.x(kAccel) * lasts);
  }
  MotionStep step;  // nobody gave any motion yet
  step.dt = dt;
  step.Q = dt * Eigen::Matrix3d::Identity();
  return step;
}

Planar LocalMotion::planar(const Channels& channels, int64_t t_us) const {
  if (t_us >= pose_.t_us()) return after_motion(pose_.pose(), motion(channels, pose_.t_us(), t_us).motion);
  // Back from there: the motion from t_us to the pose, the other way round.
  const Planar on = motion(channels, t_us, pose_.t_us()).motion;
  return after_motion(pose_.pose(), motion_between(on, Planar::Zero()));
}

Odometry LocalMotion::odometry(const Channels& channels, int64_t t_us) const {
  return full_pose(t_us, planar(channels, t_us), pose_.covariance(channels), pose_.height(), pose_.height_variance(),
                   attitude(channels, t_us));
}

Odometry LocalMotion::attitude(const Channels& channels, int64_t t_us) const {
  Odometry o = attitude_;
  if (!velocity_) return o;
  const PoseChannel& channel = channels[index_of(*velocity_)];
  const double length = velocity_ == FusionChannel::kIns ? 1.0 : channel.calibration().length();
  const double ahead = std::clamp(seconds_between(channel.t_us(), t_us), 0.0, kLongestPrediction);
  o.velocity = length * channel.odometry().velocity;
  o.velocity.x() += combined_.x(kAccel) * ahead;
  o.angular_rate = channel.odometry().angular_rate;
  o.cov_velocity = channel.odometry().cov_velocity;
  const double unknown = config_.motion.jerk * std::pow(ahead, 1.5);
  o.cov_velocity(0, 0) += unknown * unknown / 3.0;
  return o;
}

}  // namespace roadfix
