#include "health/health.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "geodesy/enu_change.h"

namespace roadfix {

namespace {

constexpr int64_t kDecisionGrid_us = 100'000;
constexpr int64_t kMaxCatchUp_us = 20'000'000;
/// Stamps that are further off than this belong to a drive that is played again.
constexpr int64_t kReplayLag_us = 2'000'000;

}  // namespace

Health::Health(const HealthConfig& config, const Expectations& expectations)
    : config_(config), expectations_(expectations), alarms_(config.alarm) {
  for (const ExpectedChannel& expected : expectations_.channels) {
    channels_.try_emplace(expected.name, expected.name, config_.channel, expected.rate);
  }
  for (const std::string& process : expectations_.processes) {
    processes_.try_emplace(process, process, config_.process, true);
  }
}

ChannelMonitor& Health::channel(const std::string& name) {
  return channels_.try_emplace(name, name, config_.channel, std::nullopt).first->second;
}

void Health::arrived(const std::string& name, const Arrival& arrival) { channel(name).arrived(arrival); }

void Health::undecodable(const std::string& name, int64_t now_us, const std::string& why) {
  channel(name).undecodable(now_us, why);
}

void Health::unusable(const std::string& name, int64_t now_us) { channel(name).unusable(now_us); }

void Health::heartbeat(const std::string& process, int64_t now_us, const HeartbeatFacts& facts) {
  const bool several = std::ranges::count(expectations_.several, process) > 0;
  processes_.try_emplace(process, process, config_.process, false, several).first->second.heartbeat(now_us, facts);
}

void Health::to_common_frame(PoseFacts& facts) {
  if (!facts.anchor) return;
  offer_anchor(*facts.anchor);
  if (same_anchor(*facts.anchor, *anchor_)) return;
  const SE3 change = T_enu_enu(*anchor_, *facts.anchor);
  facts.anchor = anchor_;
  facts.odometry.T_frame_vehicle = change * facts.odometry.T_frame_vehicle;
  const Eigen::Matrix3d R = change.R();
  Matrix6d& P = facts.odometry.cov_pose;
  P.topRows<3>() = (R * P.topRows<3>()).eval();
  P.leftCols<3>() = (P.leftCols<3>() * R.transpose()).eval();
}

void Health::pose(const std::string& name, int64_t now_us, PoseFacts facts) {
  to_common_frame(facts);
  PoseMonitor& monitor = poses_.try_emplace(name, name, config_.pose).first->second;
  if (monitor.is_restart(facts)) {
    for (auto& [source, measurements] : sources_) {
      if (source.starts_with(name + " in ")) measurements.reset();
    }
  }
  monitor.add(now_us, facts);
}

void Health::bound(const std::string& name, const BoundFacts& facts) {
  if (const auto known = poses_.find(name); known != poses_.end()) known->second.add_bound(facts);
}

void Health::measurement(const std::string& source, int64_t now_us, double nis, int dof, bool accepted) {
  sources_.try_emplace(source, source, config_.consistency).first->second.add(now_us, nis, dof, accepted);
}

void Health::host(int64_t now_us, const HostFacts& facts) {
  if (facts.kernel_drops > host_.kernel_drops) monitor_drops_.add(now_us, facts.kernel_drops - host_.kernel_drops);
  host_ = facts;
}

std::optional<int64_t> Health::next_decision(int64_t now_us) {
  if (!start_us_) {
    start_us_ = now_us;
    decided_us_ = now_us - now_us % kDecisionGrid_us;
    return std::nullopt;
  }
  const int64_t newest = now_us - now_us % kDecisionGrid_us;
  decided_us_ = std::max(decided_us_, newest - kMaxCatchUp_us);
  if (decided_us_ + kDecisionGrid_us > newest) return std::nullopt;
  return decided_us_ + kDecisionGrid_us;
}

std::string Health::judged_pose() const {
  for (const std::string& name : expectations_.judged_poses) {
    if (poses_.contains(name)) return name;
  }
  return "";
}

/// Stamps of today are taken as they are; those of a drive that is played again less what all channels have in common.
int64_t Health::median_lag_us() const {
  std::vector<int64_t> lags;
  for (const auto& [name, monitor] : channels_) {
    // What fell silent, or was forged for a while, does not count for what the time is now.
    const std::optional<int64_t> lag = monitor.is_fresh(decided_us_) ? monitor.lag_us() : std::nullopt;
    if (lag) lags.push_back(*lag);
  }
  if (lags.empty()) return lag_us_;
  const auto middle = lags.begin() + static_cast<std::ptrdiff_t>(lags.size() / 2);
  std::nth_element(lags.begin(), middle, lags.end());
  return std::abs(*middle) > kReplayLag_us ? *middle : 0;
}

bool Health::decide(int64_t now_us) {
  decided_us_ = now_us;
  lag_us_ = median_lag_us();
  std::vector<Condition> conditions;
  check_host(conditions);
  const int64_t start_us = *start_us_ + std::llround(config_.start_grace * 1e6);
  for (const auto& [name, monitor] : processes_) monitor.check(now_us, start_us, conditions);
  const std::string judged = judged_pose();
  for (auto& [name, monitor] : channels_) {
    monitor.check(now_us, start_us, lag_us_, name == judged ? Verdict::kDoNotUse : Verdict::kDegraded, conditions);
  }
  if (judged.empty()) {
    std::string names;
    for (const std::string& name : expectations_.judged_poses) names += (names.empty() ? "" : " or ") + name;
    conditions.push_back({"pose.none", Verdict::kDoNotUse, kRankPose, "No estimate yet: nobody publishes " + names});
  }
  for (const auto& [name, monitor] : poses_) monitor.check(now_us, name == judged, conditions);
  for (const auto& [name, monitor] : sources_) monitor.check(now_us, conditions);
  for (const Agreement& agreement : agreements()) check(agreement, config_.consistency.window, conditions);
  return alarms_.update(now_us, conditions);
}

void Health::check_host(std::vector<Condition>& out) const {
  if (host_.free_disk_gib && *host_.free_disk_gib < config_.process.disk_gib) {
    out.push_back({"host.disk", Verdict::kDegraded, kRankHost,
                   fmt::format("The disk has only {:.1f} GiB left", *host_.free_disk_gib)});
  }
  if (host_.clock_step_s && std::abs(*host_.clock_step_s) > config_.process.clock_step) {
    out.push_back({"host.clock", Verdict::kDegraded, kRankHost,
                   fmt::format("The computer's clock was set by {:+.1f} s; the stack goes on without the step",
                               *host_.clock_step_s)});
  }
  if (const int64_t drops = monitor_drops_.within(decided_us_); drops > 0) {
    out.push_back({"host.monitor_drops", Verdict::kDegraded, kRankHost,
                   fmt::format("The monitor itself lost {} datagrams and may miss things", drops)});
  }
}

std::vector<Agreement> Health::agreements() const {
  std::vector<Agreement> all;
  for (auto a = poses_.begin(); a != poses_.end(); ++a) {
    for (auto b = std::next(a); b != poses_.end(); ++b) {
      if (const auto agreement = compare(a->second, b->second, decided_us_, config_.consistency)) {
        all.push_back(*agreement);
      }
    }
  }
  return all;
}

HealthReport Health::report() const {
  HealthReport report;
  report.now_us = decided_us_;
  report.verdict = alarms_.verdict();
  report.since_us = alarms_.since_us();
  report.reasons = alarms_.reasons();
  report.judged_pose = judged_pose();
  report.lag_s = static_cast<double>(lag_us_) * 1e-6;
  for (const auto& [name, monitor] : channels_) report.channels.push_back(monitor.report(decided_us_, lag_us_));
  for (const auto& [name, monitor] : processes_) report.processes.push_back(monitor.report(decided_us_));
  for (const auto& [name, monitor] : poses_) report.poses.push_back(monitor.report());
  for (const auto& [name, monitor] : sources_) report.consistency.push_back(monitor.report(decided_us_));
  report.agreements = agreements();
  return report;
}

}  // namespace roadfix
