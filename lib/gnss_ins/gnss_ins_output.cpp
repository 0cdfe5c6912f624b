// What is published: the state carried forward to the newest IMU sample, and the status in words.
#include <algorithm>
#include <cmath>

#include "geometry/so3.h"
#include "gnss_ins/gnss_ins.h"

namespace roadfix {

namespace {

constexpr double kForwardSpan = 1.0;     // s that one transition of the forward covariance may cover
constexpr double kCovarianceAge = 0.05;  // s that an output covariance may be used again
constexpr char kHeadingRoughly[] = "the heading is known roughly";
constexpr char kHeightContradicts[] = "the height of GNSS contradicts and is not used";

// Covariance of pose and velocity at the true time of the output, (M.40)-(M.42).
struct OutputCovariance {
  Matrix6d pose;
  Eigen::Matrix3d velocity;

  OutputCovariance(const NavState& x, const BodyMotion& m, const OutputErrorMatrix& P) {
    // Position and velocity at the true time, rotation in imu axes, velocity in imu axes. Three rows of zeros make a
    // column whole vector registers.
    const Eigen::Matrix3d Rt = x.q_enu_imu.toRotationMatrix().transpose();
    Eigen::Matrix<double, 12, 10> J = Eigen::Matrix<double, 12, 10>::Zero();
    J.block<3, 3>(0, kPos).setIdentity();
    J.block<3, 3>(0, kVel) = x.imu_offset * Eigen::Matrix3d::Identity();
    J.block<3, 1>(0, 9) = x.velocity + x.imu_offset * m.acceleration;
    J.block<3, 3>(3, kAtt) = Rt;
    J.block<3, 1>(3, 9) = m.rate;
    J.block<3, 3>(6, kVel) = Rt;
    for (int i = 0; i < 3; ++i) J.block<1, 3>(6 + i, kAtt) = Rt.row(i).cross(x.velocity);
    J.block<3, 1>(6, 9) = Rt.lazyProduct(m.acceleration);
    const Eigen::Matrix<double, 12, 10> half = J.lazyProduct(P);
    const Eigen::Matrix<double, 12, 12> all = half.lazyProduct(J.transpose());
    pose = 0.5 * (all.topLeftCorner<6, 6>() + all.topLeftCorner<6, 6>().transpose());
    velocity = 0.5 * (all.block<3, 3>(6, 6) + all.block<3, 3>(6, 6).transpose());
  }
};

const char* waiting_for(AlignmentPhase phase, bool has_imu, bool has_fix) {
  switch (phase) {
    case AlignmentPhase::kDone:
      return "";
    case AlignmentPhase::kHeading:
      return "heading: drive, with turns or changes of speed";
    case AlignmentPhase::kLevelling:
      return "levelling: a second fix and calm samples";
    case AlignmentPhase::kWaiting:
      break;
  }
  if (!has_imu) return "IMU samples";
  return has_fix ? "levelling" : "a GNSS fix";
}

}  // namespace

const InsCore* GnssIns::core() const {
  if (phase_ == AlignmentPhase::kDone) return &*core_;
  return phase_ == AlignmentPhase::kHeading ? &bank_.leader() : nullptr;
}

void GnssIns::rebase_forward() {
  const InsCore& base = *core();
  const double behind = forward_ ? seconds_between(base.state().t_us, forward_->state().t_us) : 0.0;
  if (forward_stale_ || !forward_ || forward_to_ < ring_.begin() ||
      behind > kForwardSpan + 1e-6 * static_cast<double>(lag_us_)) {
    forward_.emplace(base);
    if (phase_ == AlignmentPhase::kHeading) forward_->replace_covariance(bank_.covariance());
    forward_->run_ahead();
    forward_to_ = ring_.begin();
    forward_stale_ = false;
    cov_at_us_ = 0;
  }
  for (; forward_to_ < ring_.end(); ++forward_to_) {
    const ImuSample& s = ring_[forward_to_];
    const double dt = seconds_between(forward_->state().t_us, s.t_us);
    if (dt > 0.0) forward_->predict(s, dt, noise_over(dt));
  }
}

GnssInsOutput GnssIns::output() {
  GnssInsOutput out;
  out.phase = phase_;
  out.reset_counter = reset_counter_;
  out.reset_delta = reset_delta_;
  out.odometry.t_us = ring_.empty() ? last_step_us_ : ring_.back().t_us;
  if (core() == nullptr) {
    out.reason = std::string("waits for ") + waiting_for(phase_, last_step_us_ != 0, fix_.has_value());
    return out;
  }
  rebase_forward();
  const NavState& x = forward_->state();
  const BodyMotion& m = forward_->motion();
  const double o = x.imu_offset;  // the sample stamped t was taken o earlier, so t itself lies o ahead
  const Eigen::Vector3d v = x.velocity + o * m.acceleration;
  SE3& T = out.odometry.T_frame_vehicle;
  T.p = x.position + o * (x.velocity + 0.5 * o * m.acceleration);
  T.q = normalized_positive(x.q_enu_imu * exp_q(o * m.rate));
  out.odometry.velocity = T.q.conjugate() * v;
  // Of the newest sample: m.rate is smoothed for lever arms, and in a turn it is tenths of a second late.
  out.odometry.angular_rate = forward_->last_step().rate - T.q.conjugate() * forward_->earth().rate();
  if (cov_at_us_ == 0 || seconds_between(cov_at_us_, x.t_us) >= kCovarianceAge) {
    const OutputCovariance cov(x, m, forward_->output_covariance());
    cov_pose_ = cov.pose;
    cov_velocity_ = cov.velocity;
    cov_at_us_ = x.t_us;
  }
  out.odometry.cov_pose = cov_pose_;
  out.odometry.cov_velocity = cov_velocity_;

  const double horizontal = std::sqrt(cov_pose_(0, 0) + cov_pose_(1, 1));
  if (!usable()) {
    out.reason = std::string("waits for ") + waiting_for(phase_, last_step_us_ != 0, fix_.has_value());
  } else if (!(horizontal < config_.alignment.invalid_sigma_m)) {
    out.reason = "position too uncertain";
  } else {
    const bool coasting = coasting_since().has_value();
    if (phase_ == AlignmentPhase::kHeading) out.reason = kHeadingRoughly;
    out.odometry.validity = coasting || unseen_ ? Validity::kCoasting : Validity::kValid;
    if (coasting) out.reason = "coasting without GNSS";
    if (unseen_) out.reason = "from the place where it was parked, without GNSS yet";
    if (height_refused_since_us_ != 0) out.reason = kHeightContradicts;
    if (monitor_.frozen()) out.reason = "IMU readings do not change";
  }
  return out;
}

std::optional<int64_t> GnssIns::coasting_since() const {
  const auto used_at = [&](AidingSource source) { return used_at_us_[static_cast<size_t>(source)]; };
  const int64_t anchored = std::max(used_at(AidingSource::kGnssPosition), used_at(AidingSource::kZeroVelocity));
  const bool coasting = usable() && seconds_between(anchored, last_step_us_) > config_.alignment.coasting_s;
  return coasting ? std::optional(anchored) : std::nullopt;
}

GnssInsStatus GnssIns::status() const {
  GnssInsStatus s;
  s.phase = phase_;
  s.waits_for = waiting_for(phase_, last_step_us_ != 0, fix_.has_value());
  s.gnss_quality = screen_.quality();
  s.gnss_reason = screen_.reason();
  if (s.gnss_reason.empty() && height_refused_since_us_ != 0) s.gnss_reason = kHeightContradicts;
  s.bad_imu_samples = bad_imu_;
  s.imu_gaps = gaps_;
  s.wheel_scale_steps = wheel_scale_steps_;
  s.imu_frozen = monitor_.frozen();
  const double hold = config_.alignment.coasting_s;
  for (size_t i = 0; i < kAidingSources; ++i)
    if (used_at_us_[i] != 0 && seconds_between(used_at_us_[i], last_step_us_) <= hold) s.aided_by |= 1 << i;
  s.coasting = coasting_since().has_value();
  s.coasting_since_us = coasting_since().value_or(0);
  return s;
}

}  // namespace roadfix
