#include "fusion/pose_channel.h"

#include <algorithm>
#include <cmath>

namespace roadfix {
namespace {

constexpr double kJump = 0.1;          ///< m, between a motion and its velocity: no motion of a vehicle
constexpr double kJumpShare = 0.2;     ///< likewise, of the way
constexpr double kHorizon = 10.0;      ///< s, of expected_error
constexpr double kUsableScale = 0.05;  ///< relative: a scale that was learnt
constexpr double kUnknownScale = 3.0;  ///< log of a scale that nobody knows

/// Of all elements at once: what is finite is nothing times zero.
template <class Values>
bool finite(const Values& values) {
  return (values.array() * 0.0).sum() == 0.0;
}

}  // namespace

bool usable(const Odometry& o) {
  return finite(o.T_frame_vehicle.p) && std::abs(o.T_frame_vehicle.q.norm() - 1.0) < 1e-3 && finite(o.velocity) &&
         finite(o.angular_rate) && finite(o.cov_pose) && finite(o.cov_velocity) &&
         o.cov_pose.diagonal().minCoeff() >= 0.0;
}

PoseChannel::PoseChannel(FusionChannel channel, const ChannelNoise& noise)
    : channel_(channel), noise_(noise), errors_(noise), calibration_(noise.calibration) {}

void PoseChannel::begin_segment() {
  track_.begin_segment();
  if (channel_ != FusionChannel::kIns) health_.begin_trial();
}

FuseStatus PoseChannel::add(const ChannelSample& s) {
  if (!usable(s.odometry)) return FuseStatus::kBadInput;
  if (ever_us_ && s.odometry.t_us <= *ever_us_) return FuseStatus::kNotReady;
  ever_us_ = s.odometry.t_us;
  const bool reset = s.reset_counter != newest_.reset_counter;
  const bool invalid = s.odometry.validity == Validity::kInvalid;
  health_.set_invalid(invalid);
  if (invalid) {
    if (has_pose_) begin_segment();
    has_pose_ = false;
    newest_.reset_counter = s.reset_counter;
    return FuseStatus::kBadQuality;
  }
  if (newest_.metric && !s.metric) calibration_.set_scale(0.0, kUnknownScale);
  const LevelView now = level_view(s.odometry);
  if (has_pose_ && seconds_between(view_.t_us, now.t_us) < noise_.timeout) {
    measure(now, s, reset);
  } else {
    begin_segment();
    correction_.setZero();
  }
  if (reset || !has_pose_ || now.pose != view_.pose) repeated_since_us_ = now.t_us;
  newest_ = s;
  has_pose_ = true;
  view_ = now;
  track_.reach(now.t_us);
  return reset ? FuseStatus::kReset : FuseStatus::kAccepted;
}

/// The motion since the last sample. Where that is no motion of a vehicle, or the channel began another map, its
/// velocities are the motion, and what comes is another segment.
void PoseChannel::measure(const LevelView& now, const ChannelSample& s, bool reset) {
  const double dt = seconds_between(view_.t_us, now.t_us);
  const VelocityMotion by_velocity = motion_by_velocity(view_, now);
  const Planar by_pose = motion_between(view_.pose, now.pose);
  const double apart = (by_pose - by_velocity.way).head<2>().norm();
  const bool jumped = apart > kJump + kJumpShare * by_velocity.way.head<2>().norm();
  correction_ = difference_of(now.pose, after_motion(view_.pose, by_velocity.way));
  P_before_ = view_.P;
  errors_.see_yaw(view_.P(2, 2), now.P(2, 2), dt);
  const bool of_a_filter = s.by_velocity || channel_ == FusionChannel::kIns;
  if (of_a_filter || jumped || reset)
    track_.add(by_velocity.way, by_velocity.rise);
  else
    track_.add(by_pose, s.odometry.T_frame_vehicle.p.z() - odometry().T_frame_vehicle.p.z());
  if (reset) calibration_.forget_scale();
  if (reset || (jumped && !of_a_filter)) begin_segment();
  calibration_.age(dt);
}

/// What it claims counts of a filter, and of a witness that says that it is coasting: wheels without a yaw rate.
Eigen::Matrix3d PoseChannel::step_noise(double dt) const {
  const bool claims = has_pose_ && (channel_ == FusionChannel::kIns || odometry().validity == Validity::kCoasting);
  return errors_.of_step(dt, claims ? &odometry() : nullptr);
}

MotionStep PoseChannel::corrected(const Planar& measured, double rise, double dt) const {
  MotionStep s = calibration_.corrected(measured, dt);
  s.rise = calibration_.length() * rise;
  s.Q = step_noise(std::abs(dt));
  if (channel_ == FusionChannel::kIns) s.by_calibration.setZero();  // its own states hold these
  return s;
}

MotionStep PoseChannel::measured(int64_t from_us, int64_t to_us) const {
  const ChannelTrack::Point from = track_.at(from_us, view_), to = track_.at(to_us, view_);
  return corrected(motion_between(from.way, to.way), to.rise - from.rise, seconds_between(from_us, to_us));
}

MotionStep PoseChannel::step(int64_t from_us) const {
  if (track_.has(from_us)) return measured(from_us, view_.t_us);
  return by_velocity(seconds_between(from_us, view_.t_us));
}

MotionStep PoseChannel::by_velocity(double dt, double change) const {
  LevelView led = view_;
  led.velocity.x() += change;
  MotionStep s = corrected(motion_ahead(led, dt), led.velocity.z() * dt, dt);
  s.Q.diagonal() += errors_.of_velocity(dt);
  return s;
}

ChannelState PoseChannel::state(int64_t t_us) const {
  const bool speaks = ever_us_ && seconds_between(*ever_us_, t_us) < noise_.timeout;
  return health_.state(speaks, alive(t_us), has_lengths());
}

bool PoseChannel::has_lengths() const {
  return newest_.metric || calibration_.covariance()(kScale, kScale) < kUsableScale * kUsableScale;
}

double PoseChannel::expected_error(double speed) const {
  const double way = kHorizon * std::max(std::abs(speed), 1.0);
  const Eigen::Matrix3d Q = step_noise(kHorizon);
  const CalibrationMatrix& P = calibration_.covariance();
  double e = Q(0, 0) + Q(1, 1) + Q(2, 2) * way * way / 3.0;
  if (channel_ != FusionChannel::kIns)
    e += way * way * (P(kScale, kScale) + P(kHeading, kHeading) + P(kDrift, kDrift) * kHorizon * kHorizon / 3.0);
  return e;
}

}  // namespace roadfix
