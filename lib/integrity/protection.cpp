#include "integrity/protection.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace roadfix {
namespace {

constexpr double kAxes = 3.0;              // the risk is of an error in any axis
constexpr double kInnovationMemory = 2.0;  // s, of their mean: a fault shows before it is followed
constexpr double kCorrectionTime = 2.0;    // s, within which positions correct a heading
constexpr double kLeastInnovations = 3.0;  // in the mean
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::array<const char*, 3> kAxisNames = {"along", "across", "up"};

Eigen::Vector3d all(double value) { return Eigen::Vector3d::Constant(value); }

const char* words(Hypothesis hypothesis) {
  switch (hypothesis) {
    case Hypothesis::kNoFault:
      return "the estimate's own uncertainty";
    case Hypothesis::kReceiver:
      return "positions may have drifted unnoticed";
    case Hypothesis::kUnverified:
      return "positions are not checked yet";
    case Hypothesis::kContradiction:
      return "positions contradict dead reckoning";
    case Hypothesis::kCoasting:
      return "no positions";
    case Hypothesis::kNoBound:
      break;
  }
  return "nothing bounds it";
}

}  // namespace

ProtectionMonitor::ProtectionMonitor(const IntegrityConfig& config)
    : config_(config), separation_(config), noise_(config.tails), whiteness_(config.tails) {}

void ProtectionMonitor::add(const PositionInnovation& z) {
  noise_.add(z.t_us, z.nis, z.dof);
  const double dt = innovation_us_ ? seconds_between(*innovation_us_, z.t_us) : 0.0;
  innovation_us_ = z.t_us;
  const double kept = std::exp(-std::max(0.0, dt) / kInnovationMemory);
  mean_innovation_ *= kept;
  innovation_weight_ *= kept;
  if (!z.accepted) {
    refused_us_ = z.t_us;
    return;
  }
  const Eigen::Vector3d sigma = z.variance.cwiseMax(1e-12).cwiseSqrt();
  mean_innovation_ += z.innovation.cwiseQuotient(sigma);
  innovation_weight_ += 1.0;
  fix_variance_ = z.variance;
  fix_us_ = z.t_us;
  separation_.set_position_time(z.t_us);
}

bool ProtectionMonitor::coasting_since(int64_t t_us) const {
  return seconds_between(t_us, separation_.now().t_us) > config_.coasting_after;
}

bool ProtectionMonitor::coasting() const { return !fix_us_ || coasting_since(*fix_us_); }

/// (P.3.2): the sum of n independent innovations has the sigma sqrt(n).
bool ProtectionMonitor::biased() const {
  if (innovation_weight_ < kLeastInnovations || !innovation_us_) return false;
  const double bound =
      whiteness_.quantile(*innovation_us_, config_.witness.false_alarm) * std::sqrt(innovation_weight_);
  return (mean_innovation_.cwiseAbs().array() > bound).any();
}

// (P.5.1): positions are absent, so that the estimate itself is dead reckoning.
void ProtectionMonitor::hold_while_coasting() {
  const Anchor& now = separation_.now();
  failed_us_ = now.t_us;
  if (refused_us_ && !coasting_since(*refused_us_)) return contradict();
  if (anchored_ && !returned_) return;
  anchor_ = now;  // what comes back is held against this
  anchored_ = returned_ = true;
}

// (P.5.2): the fault may be as old as the look-back.
void ProtectionMonitor::contradict() {
  const Anchor& now = separation_.now();
  failed_us_ = now.t_us;
  if (!anchored_) anchor_ = separation_.before(config_.look_back).value_or(now);
  anchored_ = true;
  returned_ = false;
  // A test that is tighter than dead reckoning is good for, not a fault: it is learnt.
  if (seconds_between(anchor_.t_us, now.t_us) > config_.verify && agrees_with_anchor()) separation_.learn();
}

void ProtectionMonitor::inherit_contradiction(int64_t t_us) {
  if (!first_us_) return;
  const Anchor& now = separation_.now();
  failed_us_ = now.t_us;
  returned_ = false;
  if (anchored_ && anchor_.t_us <= t_us) return;
  anchor_ = separation_.before(seconds_between(t_us, now.t_us)).value_or(now);
  anchored_ = true;
}

void ProtectionMonitor::update_checks() {
  const Anchor& now = separation_.now();
  if (!first_us_) first_us_ = now.t_us;
  if (coasting()) return hold_while_coasting();
  fix_way_ = now.way;
  if (separation_.contradicted() || biased()) return contradict();
  // (P.5.3)
  const double wait = returned_ ? config_.verify : config_.recover;
  if (anchored_ && seconds_between(*failed_us_, now.t_us) > wait && agrees_with_anchor()) anchored_ = returned_ = false;
  if (anchored_) return;
  checked_us_ = now.t_us;
  separation_.learn();
  if (innovation_us_ && innovation_weight_ >= kLeastInnovations)
    whiteness_.add(*innovation_us_, mean_innovation_.squaredNorm() / innovation_weight_, kAxes);
}

bool ProtectionMonitor::agrees_with_anchor() const {
  const Separation s = separation_.since(anchor_);
  const double k = noise_.quantile(separation_.now().t_us, config_.witness.false_alarm);
  const Eigen::Vector3d variance = s.sigma.cwiseAbs2() + anchor_.cov.diagonal();
  return (s.d.cwiseAbs().array() <= k * variance.cwiseMax(0.0).array().sqrt()).all();
}

void ProtectionMonitor::raise(int risk, const Eigen::Vector3d& level, Hypothesis hypothesis, Protection& out) const {
  Eigen::Vector3d& reached = out.level[static_cast<std::size_t>(risk)];
  const auto share = [&](const Eigen::Vector3d& l) { return l.cwiseQuotient(config_.alert_limit).maxCoeff(); };
  if (risk == kRare && share(level) > share(reached)) out.hypothesis = hypothesis;
  reached = reached.cwiseMax(level);
}

// (P.3.3)
void ProtectionMonitor::turn_lever_arm(const Eigen::Matrix3d& R_frame_vehicle) {
  const Eigen::Vector3d variance = config_.lever_arm_std.cwiseAbs2();
  if (!coasting()) lever_enu_ = R_frame_vehicle * variance.asDiagonal() * R_frame_vehicle.transpose();
  const Eigen::Matrix3d turned = R_frame_vehicle.transpose() * lever_enu_ * R_frame_vehicle;
  lever_variance_ = variance.cwiseMax(turned.diagonal());
}

// (P.3.1)
void ProtectionMonitor::apply_no_fault(const Odometry& estimate, Protection& out) const {
  const bool begins = seconds_between(*first_us_, estimate.t_us) < config_.verify;
  const double share = anchored_ || begins ? 1.0 : config_.correlated_share;
  const Eigen::Matrix3d R = estimate.T_frame_vehicle.R().transpose();
  const Eigen::Vector3d common = share * share * (R * fix_variance_.asDiagonal() * R.transpose()).diagonal();
  const double late = config_.timing_std * turning_ * kCorrectionTime;  // a heading late by that, followed so long
  const Eigen::Vector3d timing(0.0, late * late, 0.0);
  const Eigen::Vector3d sigma =
      (separation_.now().cov.diagonal() + lever_variance_ + common + timing).cwiseMax(0.0).cwiseSqrt();
  const std::array<double, kRisks> risks = {config_.frequent_risk, config_.rare_risk};
  for (int r = 0; r < kRisks; ++r) {
    const double k = noise_.quantile(estimate.t_us, risks[static_cast<std::size_t>(r)] / kAxes);
    raise(r, k * sigma, Hypothesis::kNoFault, out);
  }
}

// (P.4.8)
void ProtectionMonitor::apply_receiver(Protection& out) const {
  if (!sound_) return;
  const Separation s = separation_.since(*sound_);
  const std::array<double, kRisks> risks = {config_.frequent_risk, config_.rare_risk};
  for (int r = 0; r < kRisks; ++r) {
    const double risk = std::min(0.5, risks[static_cast<std::size_t>(r)] / (kAxes * config_.fault_prior));
    Eigen::Vector3d level;
    for (int a = 0; a < 3; ++a) {
      const double own =
          noise_.quantile(out.pose_us, risk) * std::sqrt(std::max(0.0, sound_->cov(a, a)) + lever_variance_(a));
      level(a) = std::abs(s.d(a)) + std::hypot(own, separation_.quantile(a, risk) * s.sigma(a));
    }
    raise(r, level, Hypothesis::kReceiver, out);
  }
}

// (P.5.5)
void ProtectionMonitor::apply_anchor(Protection& out) const {
  if (!anchored_) return;
  const Hypothesis hypothesis = returned_ ? Hypothesis::kUnverified : Hypothesis::kContradiction;
  const Separation s = separation_.since(anchor_);
  const std::array<double, kRisks> risks = {config_.frequent_risk, config_.rare_risk};
  for (int r = 0; r < kRisks; ++r) {
    if (!s.witnessed && !returned_) {
      raise(r, all(kInfinity), hypothesis, out);
      continue;
    }
    const double k = noise_.quantile(out.pose_us, risks[static_cast<std::size_t>(r)] / kAxes);
    const Eigen::Vector3d variance = anchor_.cov.diagonal().cwiseMax(0.0) + lever_variance_ + s.sigma.cwiseAbs2();
    raise(r, s.d.cwiseAbs() + k * variance.cwiseSqrt(), hypothesis, out);
  }
}

// (P.6.1)
void ProtectionMonitor::apply_coasting(Protection& out) const {
  const Anchor& now = separation_.now();
  if (!coasting()) return;
  for (Eigen::Vector3d& level : out.level) level += (now.way - fix_way_) * config_.coasting_fault;
  if (now.way > fix_way_) out.hypothesis = Hypothesis::kCoasting;
}

void ProtectionMonitor::judge(Protection& out) const {
  const Eigen::Vector3d& level = out.level[kRare];
  Eigen::Index axis = 0;
  const double worst = level.cwiseQuotient(config_.alert_limit).maxCoeff(&axis);
  out.usable = worst <= 1.0;
  if (out.usable) return;
  out.reason = std::isfinite(worst) ? fmt::format("{} m {} where {} m may be: {}", fmt::format("{:.2f}", level(axis)),
                                                  kAxisNames[static_cast<std::size_t>(axis)], config_.alert_limit(axis),
                                                  words(out.hypothesis))
                                    : words(out.hypothesis);
}

Protection ProtectionMonitor::bound(const Odometry& estimate) {
  Protection out;
  out.pose_us = estimate.t_us;
  const bool known = estimate.validity != Validity::kInvalid && estimate.cov_pose.allFinite() &&
                     (estimate.cov_pose.diagonal().head<3>().array() > 0.0).all();
  if (!known) {
    out.level.fill(all(kInfinity));
    out.reason = "the pose is not valid";
    return out;
  }
  out.level.fill(Eigen::Vector3d::Zero());
  out.hypothesis = Hypothesis::kNoFault;
  const double dt = first_us_ ? seconds_between(separation_.now().t_us, estimate.t_us) : 0.0;
  const double lateral = std::abs(estimate.velocity.x() * estimate.angular_rate.z());
  turning_ = std::max(lateral, turning_ * std::exp(-std::max(0.0, dt) / kCorrectionTime));
  separation_.step(estimate);
  update_checks();
  if (!fix_us_) {
    out.level.fill(all(kInfinity));
    out.hypothesis = Hypothesis::kNoBound;
  } else {
    turn_lever_arm(estimate.T_frame_vehicle.R());
    apply_no_fault(estimate, out);
    if (!anchored_) sound_ = separation_.before(config_.witness.short_lag);
    if (!anchored_ || returned_) apply_receiver(out);
    apply_anchor(out);
    apply_coasting(out);
  }
  out.since_check = seconds_between(checked_us_.value_or(*first_us_), estimate.t_us);
  judge(out);
  return out;
}

}  // namespace roadfix
