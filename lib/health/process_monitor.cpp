#include "health/process_monitor.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace roadfix {

namespace {

constexpr double kMebi = 1024.0 * 1024.0;
constexpr std::size_t kIntervals = 5;
constexpr double kEstablished = 2.0;         // s of heartbeats, after which an unexpected process is missed, too
constexpr double kHeartbeatIntervals = 2.5;  // intervals without a heartbeat
constexpr double kMinSilence = 0.5;          // s, however fast it beats

double in_seconds(int64_t us) { return static_cast<double>(us) * 1e-6; }

}  // namespace

void ProcessMonitor::heartbeat(int64_t now_us, const HeartbeatFacts& facts) {
  if (newest_ && newest_->run != facts.run) {
    change_run(now_us, facts.run);
  } else if (newest_ && facts.kernel_drops > newest_->kernel_drops) {
    drops_.add(now_us, facts.kernel_drops - newest_->kernel_drops);
  }
  if (newest_ && newest_->run == facts.run) {
    intervals_us_.push_back(now_us - now_us_);
    if (intervals_us_.size() > kIntervals) intervals_us_.pop_front();
  }
  if (!newest_ || newest_->run != facts.run) first_us_ = now_us;
  newest_ = facts;
  now_us_ = now_us;
}

/// One new run is a restart; going back and forth between two is two that live, both beating in every period.
void ProcessMonitor::change_run(int64_t now_us, int64_t run) {
  intervals_us_.clear();
  const int64_t other = std::exchange(previous_run_, newest_->run);
  if (several_) return;
  if (run == other) {
    run_alternations_.add(now_us);
  } else {
    ++restarts_;
    restarted_.add(now_us);
  }
}

/// A process that beats fast is missed soon: by the longest of its last intervals, so that an early one does not count.
double ProcessMonitor::silent_after() const {
  if (intervals_us_.size() < kIntervals) return limits_.heartbeat;
  const double longest = in_seconds(*std::max_element(intervals_us_.begin(), intervals_us_.end()));
  return std::clamp(kHeartbeatIntervals * longest, std::min(kMinSilence, limits_.heartbeat), limits_.heartbeat);
}

/// A few heartbeats of a process that nobody expects may be forged, or of a test: it is not missed.
bool ProcessMonitor::silent(int64_t now_us) const {
  return newest_ && (expected_ || in_seconds(now_us_ - first_us_) > kEstablished) &&
         in_seconds(now_us - now_us_) > silent_after();
}

Condition ProcessMonitor::condition(const std::string& what, const std::string& text) const {
  return {"process." + name_ + "." + what, Verdict::kDegraded, kRankProcess, name_ + " " + text};
}

void ProcessMonitor::check(int64_t now_us, int64_t start_us, std::vector<Condition>& out) const {
  if (!newest_) {
    if (now_us >= start_us) out.push_back(condition("missing", "has shown no sign of life"));
    return;
  }
  if (newest_->state == ProcessState::kStopping) {
    out.push_back(condition("stopped", "was stopped"));
    return;
  }
  if (silent(now_us)) {
    out.push_back(
        condition("silent", fmt::format("has shown no sign of life for {:.0f} s", in_seconds(now_us - now_us_))));
    return;
  }
  if (run_alternations_.within(now_us) > 0) out.push_back(condition("twice", "runs twice at once: end one of the two"));
  if (restarted_.within(now_us) > 0) out.push_back(condition("restarted", "was started anew"));
  if (newest_->state == ProcessState::kNoClock)
    out.push_back(condition("no_clock", "stands still: " + newest_->reason));
  if (newest_->state == ProcessState::kDegraded) out.push_back(condition("degraded", "says: " + newest_->reason));
  check_load(now_us, out);
}

void ProcessMonitor::check_load(int64_t now_us, std::vector<Condition>& out) const {
  const HeartbeatFacts& f = *newest_;
  if (f.cpu_share > limits_.cpu_share)
    out.push_back(condition("cpu", fmt::format("takes {:.0f} % of a processor core", 100.0 * f.cpu_share)));
  if (static_cast<double>(f.rss_bytes) > limits_.memory_mib * kMebi)
    out.push_back(condition("memory", fmt::format("holds {:.0f} MiB", static_cast<double>(f.rss_bytes) / kMebi)));
  if (f.queue_age_s > limits_.queue_age)
    out.push_back(
        condition("behind", fmt::format("is behind: {} waits {:.1f} s for it", f.queue_channel, f.queue_age_s)));
  if (const int64_t drops = drops_.within(now_us); drops > 0)
    out.push_back(condition("kernel_drops", fmt::format("lost {} datagrams: the kernel had no room for them", drops)));
}

ProcessReport ProcessMonitor::report(int64_t now_us) const {
  ProcessReport report;
  report.name = name_;
  report.newest = newest_;
  report.restarts = restarts_;
  if (newest_) report.age_s = in_seconds(now_us - now_us_);
  report.silent = silent(now_us);
  return report;
}

}  // namespace roadfix
