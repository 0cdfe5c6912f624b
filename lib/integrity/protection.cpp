#include "integrity/protection.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace roadfix {
namespace {

constexpr double kAxes = 3.0;  // the risk is of an error in any axis
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
    : config_(config), separation_(config), positions_(config.tails) {}

void ProtectionMonitor::add(const PositionInnovation& z) {
  positions_.add(z);
  if (z.accepted) separation_.set_position_time(z.t_us);
}

bool ProtectionMonitor::coasting_since(int64_t t_us) const {
  return seconds_between(t_us, separation_.now().t_us) > config_.coasting_after;
}

bool ProtectionMonitor::coasting() const { return !positions_.used_us() || coasting_since(*positions_.used_us()); }

Anchor ProtectionMonitor::before(double lag) const { return separation_.before(lag).value_or(separation_.now()); }

// (P.5.2): the fault may be as old as the look-back.
void ProtectionMonitor::contradict() {
  const Anchor& now = separation_.now();
  suspicion_.contradict(before(config_.look_back), now);
  // A test that is tighter than dead reckoning is good for, not a fault: it is learnt.
  if (seconds_between(suspicion_.anchor().t_us, now.t_us) > config_.verify && agrees_with_anchor()) separation_.learn();
}

void ProtectionMonitor::inherit_contradiction(int64_t t_us) {
  if (!first_us_) return;
  const Anchor& now = separation_.now();
  suspicion_.inherit(t_us, before(seconds_between(t_us, now.t_us)), now);
}

void ProtectionMonitor::update_checks() {
  const Anchor& now = separation_.now();
  if (!first_us_) first_us_ = now.t_us;
  if (coasting()) {
    // (P.5.1): positions are absent, so that the estimate itself is dead reckoning.
    const std::optional<int64_t> rejected_us = positions_.rejected_us();
    return rejected_us && !coasting_since(*rejected_us) ? contradict() : suspicion_.begin_outage(now);
  }
  fix_way_ = now.way;
  if (separation_.contradicted() || positions_.biased(config_.witness.false_alarm)) return contradict();
  // (P.5.3)
  const double wait = suspicion_.of_outage() ? config_.verify : config_.recover;
  if (suspicion_.raised() && suspicion_.quiet_for(now.t_us) > wait && agrees_with_anchor()) suspicion_.end();
  if (suspicion_.raised()) return;
  checked_us_ = now.t_us;
  separation_.learn();
  positions_.learn();
}

bool ProtectionMonitor::agrees_with_anchor() const {
  const Separation s = separation_.since(suspicion_.anchor());
  const double k = positions_.quantile(separation_.now().t_us, config_.witness.false_alarm);
  const Eigen::Vector3d variance = s.sigma.cwiseAbs2() + suspicion_.anchor().cov.diagonal();
  return (s.d.cwiseAbs().array() <= k * variance.cwiseMax(0.0).array().sqrt()).all();
}

void ProtectionMonitor::raise(int risk, const Eigen::Vector3d& level, Hypothesis hypothesis, Protection& out) const {
  Eigen::Vector3d& reached = out.level[static_cast<std::size_t>(risk)];
  const auto share = [&](const Eigen::Vector3d& l) { return l.cwiseQuotient(config_.alert_limit).maxCoeff(); };
  if (risk == kRare && share(level) > share(reached)) out.hypothesis = hypothesis;
  reached = reached.cwiseMax(level);
}

// (P.3.1)
void ProtectionMonitor::apply_no_fault(const Odometry& estimate, Protection& out) const {
  const bool begins = seconds_between(*first_us_, estimate.t_us) < config_.verify;
  const double share = suspicion_.raised() || begins ? 1.0 : config_.correlated_share;
  const Eigen::Matrix3d R = estimate.T_frame_vehicle.R().transpose();
  const Eigen::Vector3d common = share * share * (R * positions_.variance().asDiagonal() * R.transpose()).diagonal();
  const Eigen::Vector3d timing = unclaimed_.timing_variance(config_.timing_std);
  const Eigen::Vector3d sigma =
      (separation_.now().cov.diagonal() + unclaimed_.lever_variance() + common + timing).cwiseMax(0.0).cwiseSqrt();
  const std::array<double, kRisks> risks = {config_.frequent_risk, config_.rare_risk};
  for (int r = 0; r < kRisks; ++r) {
    const double k = positions_.quantile(estimate.t_us, risks[static_cast<std::size_t>(r)] / kAxes);
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
      const double own = positions_.quantile(out.pose_us, risk) *
                         std::sqrt(std::max(0.0, sound_->cov(a, a)) + unclaimed_.lever_variance()(a));
      level(a) = std::abs(s.d(a)) + std::hypot(own, separation_.quantile(a, risk) * s.sigma(a));
    }
    raise(r, level, Hypothesis::kReceiver, out);
  }
}

// (P.5.5)
void ProtectionMonitor::apply_anchor(Protection& out) const {
  if (!suspicion_.raised()) return;
  const bool of_outage = suspicion_.of_outage();
  const Hypothesis hypothesis = of_outage ? Hypothesis::kUnverified : Hypothesis::kContradiction;
  const Separation s = separation_.since(suspicion_.anchor());
  const std::array<double, kRisks> risks = {config_.frequent_risk, config_.rare_risk};
  for (int r = 0; r < kRisks; ++r) {
    if (!s.witnessed && !of_outage) {
      raise(r, all(kInfinity), hypothesis, out);
      continue;
    }
    const double k = positions_.quantile(out.pose_us, risks[static_cast<std::size_t>(r)] / kAxes);
    const Eigen::Vector3d variance =
        suspicion_.anchor().cov.diagonal().cwiseMax(0.0) + unclaimed_.lever_variance() + s.sigma.cwiseAbs2();
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
  unclaimed_.see_turn(estimate, dt);
  separation_.step(estimate);
  update_checks();
  if (!positions_.used_us()) {
    out.level.fill(all(kInfinity));
    out.hypothesis = Hypothesis::kNoBound;
  } else {
    unclaimed_.turn_lever_arm(estimate.T_frame_vehicle.R(), config_.lever_arm_std, coasting());
    apply_no_fault(estimate, out);
    if (!suspicion_.raised()) sound_ = separation_.before(config_.witness.short_lag);
    if (!suspicion_.of_contradiction()) apply_receiver(out);
    apply_anchor(out);
    apply_coasting(out);
  }
  out.since_check = seconds_between(checked_us_.value_or(*first_us_), estimate.t_us);
  judge(out);
  return out;
}

}  // namespace roadfix
