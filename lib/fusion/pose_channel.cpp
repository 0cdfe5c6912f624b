#include "fusion/pose_channel.h"

#include <algorithm>
#include <cmath>

namespace roadfix {
namespace {

constexpr double kRecent = 0.8;             ///< s
constexpr int kTrial = 4;                   ///< epochs of agreement: 2 s
constexpr double kJump = 0.1;               ///< m, between a motion and its velocity: no motion of a vehicle
constexpr double kJumpShare = 0.2;          ///< likewise, of the way
constexpr double kHorizon = 10.0;           ///< s, of expected_error
constexpr double kAcceleration = 1.0;       ///< m/s2, RMS in traffic: what a velocity does not know of the time after
constexpr double kTurnAcceleration = 0.2;   ///< rad/s2, likewise
constexpr double kUsableScale = 0.05;       ///< relative: a scale that was learnt
constexpr double kUnknownScale = 3.0;       ///< log of a scale that nobody knows
constexpr double kLargestFactor = 25.0;     ///< five times the sigma
constexpr double kAdaptation = 1.0 / 15.0;  ///< of one window of 1 s

/// Of all elements at once: what is finite is nothing times zero.
template <class Values>
bool finite(const Values& values) {
  return (values.array() * 0.0).sum() == 0.0;
}

double square(double x) { return x * x; }

}  // namespace

bool usable(const Odometry& o) {
  return finite(o.T_frame_vehicle.p) && std::abs(o.T_frame_vehicle.q.norm() - 1.0) < 1e-3 && finite(o.velocity) &&
         finite(o.angular_rate) && finite(o.cov_pose) && finite(o.cov_velocity) &&
         o.cov_pose.diagonal().minCoeff() >= 0.0;
}

PoseChannel::PoseChannel(FusionChannel channel, const ChannelNoise& noise)
    : channel_(channel), noise_(noise), calibration_(noise.calibration) {}

void PoseChannel::begin_segment() {
  ++segment_;
  recent_.clear();
  if (channel_ != FusionChannel::kIns) trial_left_ = kTrial;
}

FuseStatus PoseChannel::add(const ChannelSample& s) {
  if (!usable(s.odometry)) return FuseStatus::kBadInput;
  if (ever_us_ && s.odometry.t_us <= *ever_us_) return FuseStatus::kNotReady;
  ever_us_ = s.odometry.t_us;
  was_reset_ = s.reset_counter != reset_counter_;
  reset_counter_ = s.reset_counter;
  invalid_ = s.odometry.validity == Validity::kInvalid;
  if (invalid_) {
    if (last_) begin_segment();
    last_.reset();
    return FuseStatus::kBadQuality;
  }
  if (metric_ && !s.metric) calibration_.set_scale(0.0, kUnknownScale);
  metric_ = s.metric;
  const LevelView now = level_view(s.odometry);
  if (last_ && seconds_between(view_.t_us, now.t_us) < noise_.timeout) {
    measure(now, s.odometry.T_frame_vehicle.p.z(), s);
  } else {
    begin_segment();
    correction_.setZero();
  }
  if (was_reset_ || !last_ || now.pose != view_.pose) repeated_since_us_ = now.t_us;
  last_ = s.odometry;
  view_ = now;
  while (!recent_.empty() && seconds_between(recent_.front().t_us, now.t_us) > kRecent) recent_.pop_front();
  track_.t_us = now.t_us;
  recent_.push_back(track_);
  enu_ = s.enu;
  lengths_of_wheels_ = s.lengths_of_wheels;
  return was_reset_ ? FuseStatus::kReset : FuseStatus::kAccepted;
}

/// The motion since the last sample. Where that is no motion of a vehicle, or the channel began another map, its
/// velocities are the motion, and what comes is another segment.
void PoseChannel::measure(const LevelView& now, double z, const ChannelSample& s) {
  const double dt = seconds_between(view_.t_us, now.t_us);
  const VelocityMotion by_velocity = motion_by_velocity(view_, now);
  const Planar by_pose = motion_between(view_.pose, now.pose);
  const double apart = (by_pose - by_velocity.way).head<2>().norm();
  const bool jumped = apart > kJump + kJumpShare * by_velocity.way.head<2>().norm();
  correction_ = difference_of(now.pose, after_motion(view_.pose, by_velocity.way));
  P_before_ = view_.P;
  yaw_growth_ = dt > 0.0 ? std::max(0.0, now.P(2, 2) - view_.P(2, 2)) / dt : 0.0;
  const bool of_a_filter = s.by_velocity || channel_ == FusionChannel::kIns;
  if (of_a_filter || jumped || was_reset_) {
    track_.way = after_motion(track_.way, by_velocity.way);
    track_.rise += by_velocity.rise;
  } else {
    track_.way = after_motion(track_.way, by_pose);
    track_.rise += z - last_->T_frame_vehicle.p.z();
  }
  if (was_reset_) calibration_.forget_scale();
  if (was_reset_ || (jumped && !of_a_filter)) begin_segment();
  calibration_.age(dt);
}

PoseChannel::TrackPoint PoseChannel::track_at(int64_t t_us) const {
  if (recent_.empty() || t_us >= recent_.back().t_us)
    return {t_us, after_motion(track_.way, motion_ahead(view_, since(t_us))),
            track_.rise + since(t_us) * view_.velocity.z()};
  const auto after = std::upper_bound(recent_.begin(), recent_.end(), t_us,
                                      [](int64_t t, const TrackPoint& point) { return t < point.t_us; });
  if (after == recent_.begin()) return *after;
  const TrackPoint& before = *std::prev(after);
  const double share = seconds_between(before.t_us, t_us) / seconds_between(before.t_us, after->t_us);
  return {t_us, after_motion(before.way, share * motion_between(before.way, after->way)),
          before.rise + share * (after->rise - before.rise)};
}

Eigen::Matrix3d PoseChannel::step_noise(double dt) const {
  Eigen::Vector3d q(square(noise_.place), square(noise_.place), square(noise_.yaw));
  q *= dt;
  q.head<2>() *= factors_(0);
  q(2) *= factors_(1);
  // What it claims counts of a filter, and of a witness that says that it is coasting: wheels without a yaw rate.
  if (last_ && (channel_ == FusionChannel::kIns || last_->validity == Validity::kCoasting)) {
    // Its velocity's error lasts: as the white noise that displaces as much over twice that time.
    const double lasts = 2.0 * noise_.correlation * dt;
    for (int i = 0; i < 2; ++i) q(i) += lasts * last_->cov_velocity(i, i);
    q(2) += yaw_growth_ * dt;
  }
  return q.asDiagonal();
}

MotionStep PoseChannel::corrected(const Planar& measured, double rise, double dt) const {
  MotionStep s = calibration_.corrected(measured, dt);
  s.rise = calibration_.length() * rise;
  s.Q = step_noise(std::abs(dt));
  if (channel_ == FusionChannel::kIns) s.by_calibration.setZero();  // its own states hold these
  return s;
}

MotionStep PoseChannel::measured(int64_t from_us, int64_t to_us) const {
  const TrackPoint from = track_at(from_us), to = track_at(to_us);
  return corrected(motion_between(from.way, to.way), to.rise - from.rise, seconds_between(from_us, to_us));
}

MotionStep PoseChannel::step(int64_t from_us) const {
  if (has_track(from_us)) return measured(from_us, view_.t_us);
  return by_velocity(seconds_between(from_us, view_.t_us));
}

MotionStep PoseChannel::by_velocity(double dt, double change) const {
  LevelView led = view_;
  led.velocity.x() += change;
  MotionStep s = corrected(motion_ahead(led, dt), led.velocity.z() * dt, dt);
  s.Q.diagonal().head<2>().array() += square(noise_.velocity * dt) + square(0.5 * kAcceleration * dt * dt);
  s.Q(2, 2) += square(0.5 * kTurnAcceleration * dt * dt);
  return s;
}

ChannelState PoseChannel::state(int64_t t_us) const {
  if (invalid_ && ever_us_ && seconds_between(*ever_us_, t_us) < noise_.timeout) return ChannelState::kInvalid;
  if (!alive(t_us)) return ChannelState::kSilent;
  if (frozen_) return ChannelState::kFrozen;
  if (contradicted_) return ChannelState::kContradicted;
  if (trial_left_ > 0 || !has_lengths()) return ChannelState::kOnTrial;
  return ChannelState::kGood;
}

bool PoseChannel::has_lengths() const {
  return metric_ || calibration_.covariance()(kScale, kScale) < square(kUsableScale);
}

void PoseChannel::judge(bool contradicted, bool agreed) {
  contradicted_ = contradicted;
  if (trial_left_ == 0) return;
  trial_left_ = agreed && !contradicted ? trial_left_ - 1 : kTrial;
}

double PoseChannel::repeated(int64_t t_us) const { return seconds_between(repeated_since_us_, t_us); }

double PoseChannel::expected_error(double speed) const {
  const double way = kHorizon * std::max(std::abs(speed), 1.0);
  const Eigen::Matrix3d Q = step_noise(kHorizon);
  const CalibrationMatrix& P = calibration_.covariance();
  double e = Q(0, 0) + Q(1, 1) + Q(2, 2) * way * way / 3.0;
  if (channel_ != FusionChannel::kIns)
    e += way * way * (P(kScale, kScale) + P(kHeading, kHeading) + P(kDrift, kDrift) * kHorizon * kHorizon / 3.0);
  return e;
}

Eigen::Matrix3d PoseChannel::window_noise(const Planar& motion, double dt) const {
  const double way2 = motion.head<2>().squaredNorm();
  const double yaw = factors_(1) * square(noise_.yaw) * dt, first = square(noise_.yaw_jitter);
  const double place = factors_(0) * square(noise_.place) * dt + 2.0 * square(noise_.jitter);
  Eigen::Vector3d q(place, place, yaw + 2.0 * first);
  q.head<2>().array() += way2 * (yaw / 3.0 + first);
  return q.asDiagonal();
}

void PoseChannel::adapt(const Planar& residual, const Planar& motion, double dt, const Eigen::Matrix3d& reference) {
  const Eigen::Matrix3d own = window_noise(motion, dt);
  const auto one = [&](double& factor, double squared, double expected, double q) {
    const double nominal = q / factor;  // of factor 1
    const double trust = q / (q + expected);
    factor += kAdaptation * trust * ((squared - expected) / nominal - factor);
    factor = std::clamp(factor, 1.0, kLargestFactor);
  };
  one(factors_(0), 0.5 * residual.head<2>().squaredNorm(), 0.5 * reference.topLeftCorner<2, 2>().trace(),
      0.5 * own.topLeftCorner<2, 2>().trace());
  one(factors_(1), square(residual.z()), reference(2, 2), own(2, 2));
}

}  // namespace roadfix
