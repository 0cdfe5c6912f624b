#include "health/channel_monitor.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

namespace roadfix {

namespace {

constexpr int64_t kWindow_us = 1'000'000;
constexpr std::size_t kWindowMessages = 256;
/// Slow channels are described by their last few messages, up to this age.
constexpr std::size_t kMinMessages = 6;
constexpr int64_t kMaxAge_us = 12'000'000;
/// Share of the intervals that must lie near their median before a channel counts as regular.
constexpr double kRegularShare = 0.7;
constexpr double kNear = 0.5;
constexpr double kStale = 1.0;    // s after which the stamps of a channel without a rate are not used any more
constexpr double kScatter = 3.0;  // standard deviations of the arrival that a slow channel may be overdue
/// A rate this much above the expected one is the new expectation.
constexpr double kFaster = 1.2;
constexpr std::array<std::string_view, 10> kEventPrefixes = {
    "LEDGER_", "CONFIG_", "STATE_", "START_", "HORIZON_", "HEARTBEAT_", "RAW_", "HEALTH", "VO_RESTART", "AIDING_"};
constexpr int64_t kTwoPublishers = 3;
/// Of one gap; a forged number must not overflow the sum.
constexpr int64_t kMaxLost = 1'000'000'000;

double seconds(int64_t us) { return static_cast<double>(us) * 1e-6; }

int64_t median_of(std::vector<int64_t>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

std::string per_second(double rate_hz) { return fmt::format("{:.3g} per second", rate_hz); }

}  // namespace

bool is_periodic(const std::string& channel) {
  return std::none_of(kEventPrefixes.begin(), kEventPrefixes.end(),
                      [&](std::string_view prefix) { return channel.starts_with(prefix); });
}

ChannelMonitor::ChannelMonitor(const std::string& name, const ChannelLimits& limits, std::optional<double> expected_hz)
    : name_(name),
      limits_(limits),
      periodic_(is_periodic(name)),
      configured_(expected_hz.has_value()),
      expected_hz_(expected_hz) {}

void ChannelMonitor::arrived(const Arrival& arrival) {
  if (received_ == 0 || silent(arrival.now_us)) window_.clear();  // a rate over a silence describes neither side
  count_sequence(arrival);
  detect_stamp_jump(arrival);
  ++received_;
  window_.push_back({arrival.now_us, arrival.utime});
  while (window_.size() > kWindowMessages ||
         (window_.size() > kMinMessages && arrival.now_us - window_.front().now_us > kWindow_us) ||
         arrival.now_us - window_.front().now_us > kMaxAge_us) {
    window_.pop_front();
  }
  if (!arrival.content || arrival.content != content_) {
    content_since_us_ = arrival.now_us;
    content_messages_ = 0;
  }
  content_ = arrival.content;
  ++content_messages_;
}

void ChannelMonitor::count_sequence(const Arrival& arrival) {
  if (received_ > 0 && arrival.run == run_) {
    if (arrival.seq > seq_ + 1) lost_.add(arrival.now_us, std::min(arrival.seq - seq_ - 1, kMaxLost));
    seq_ = std::max(seq_, arrival.seq);
    return;
  }
  // One new run is a restart; going back and forth between two is two publishers.
  if (received_ > 0 && arrival.run == previous_run_) run_changes_.add(arrival.now_us);
  previous_run_ = run_;
  run_ = arrival.run;
  seq_ = arrival.seq;
  first_us_ = arrival.now_us;
  relearn_rate_ = true;  // a process that was configured anew may have another rate
  window_.clear();
}

void ChannelMonitor::detect_stamp_jump(const Arrival& arrival) {
  if (window_.empty() || !periodic_) return;
  const ArrivalTimes& last = window_.back();
  const double jump = seconds((arrival.utime - last.utime) - (arrival.now_us - last.now_us));
  if (std::abs(jump) <= limits_.stamp_jump) return;
  stamp_jumps_.add(arrival.now_us);
  stamp_jump_s_ = jump;
  seq_ = arrival.seq;  // the same drive played again counts from its beginning
  window_.clear();
}

void ChannelMonitor::undecodable(int64_t now_us, const std::string& why) {
  undecodable_.add(now_us);
  why_undecodable_ = why;
}

std::optional<int64_t> ChannelMonitor::lag_us() const {
  if (window_.empty() || !periodic_) return std::nullopt;
  std::vector<int64_t> lags;
  for (const ArrivalTimes& arrival : window_) lags.push_back(arrival.now_us - arrival.utime);
  return median_of(lags);
}

bool ChannelMonitor::is_fresh(int64_t now_us) const {
  return !window_.empty() && seconds(now_us - window_.back().now_us) <= std::max(kStale, 1.5 * silent_after());
}

/// The rate that the stamps show (MODEL.md, section 1), once they have shown it long and regularly enough.
void ChannelMonitor::learn_rate(int64_t now_us) {
  if (!periodic_ || configured_ || window_.size() < kMinMessages) return;
  if (seconds(now_us - first_us_) < limits_.learn) return;
  std::vector<int64_t> intervals;
  for (std::size_t i = 1; i < window_.size(); ++i) intervals.push_back(window_[i].utime - window_[i - 1].utime);
  const double period = static_cast<double>(median_of(intervals));
  if (period <= 0.0) return;
  const auto regular = std::count_if(intervals.begin(), intervals.end(), [&](int64_t interval) {
    return std::abs(static_cast<double>(interval) - period) < kNear * period;
  });
  if (static_cast<double>(regular) < kRegularShare * static_cast<double>(intervals.size())) return;
  const double rate = 1e6 / period;
  if (!relearn_rate_ && expected_hz_) {
    // A burst is no new rate: what comes faster must have come so for as long as a rate takes to be known.
    if (rate <= kFaster * *expected_hz_) {
      faster_since_us_.reset();
      return;
    }
    if (!faster_since_us_) faster_since_us_ = now_us;
    if (seconds(now_us - *faster_since_us_) < limits_.learn) return;
  }
  faster_since_us_.reset();
  expected_hz_ = rate;
  relearn_rate_ = false;
}

double ChannelMonitor::rate_hz(int64_t now_us) const {
  if (window_.size() < 2 || silent(now_us)) return 0.0;
  const int64_t span = window_.back().now_us - window_.front().now_us;
  return span > 0 ? static_cast<double>(window_.size() - 1) / seconds(span) : 0.0;
}

bool ChannelMonitor::silent(int64_t now_us) const {
  if (!periodic_ || !expected_hz_ || window_.empty()) return false;
  return seconds(now_us - window_.back().now_us) > silent_after();
}

/// (H.1.4). 0: not known. A fast channel may miss a message or two; a slow one is missed soon after it was due.
double ChannelMonitor::silent_after() const {
  if (!expected_hz_) return 0.0;
  const double period = 1.0 / *expected_hz_;
  const double due = period + std::max(limits_.silent_at_least, kScatter * jitter_s());
  return std::max(std::min(limits_.silent_periods * period, due), limits_.silent_at_least);
}

double ChannelMonitor::jitter_s() const {
  if (window_.size() < 3) return 0.0;
  const double mean = seconds(window_.back().now_us - window_.front().now_us) / static_cast<double>(window_.size() - 1);
  double sum = 0.0;
  for (std::size_t i = 1; i < window_.size(); ++i) {
    sum += std::pow(seconds(window_[i].now_us - window_[i - 1].now_us) - mean, 2);
  }
  return std::sqrt(sum / static_cast<double>(window_.size() - 1));
}

Condition ChannelMonitor::condition(const std::string& what, Verdict verdict, const std::string& text) const {
  const bool estimate = name_.starts_with("POSE_");
  return {"channel." + name_ + "." + what, verdict, estimate ? kRankPose : kRankSensor, name_ + " " + text};
}

void ChannelMonitor::check(int64_t now_us, int64_t start_us, int64_t lag_us, Verdict if_silent,
                           std::vector<Condition>& out) {
  learn_rate(now_us);
  if (received_ == 0) {
    if (now_us < start_us) return;
    const std::string wanted = expected_hz_ ? fmt::format(" ({} expected)", per_second(*expected_hz_)) : "";
    out.push_back(condition("missing", if_silent, "has not been heard at all" + wanted));
  } else if (silent(now_us)) {
    out.push_back(condition("silent", if_silent,
                            fmt::format("is silent for {:.1f} s ({} expected)", seconds(now_us - window_.back().now_us),
                                        per_second(*expected_hz_))));
  } else {
    check_rate(now_us, out);
    check_stamps(now_us, lag_us, out);
  }
  check_contents(now_us, out);
}

void ChannelMonitor::check_rate(int64_t now_us, std::vector<Condition>& out) const {
  const double rate = rate_hz(now_us);
  if (periodic_ && expected_hz_ && window_.size() >= kMinMessages && rate < limits_.slow_share * *expected_hz_) {
    out.push_back(condition("slow", Verdict::kDegraded,
                            fmt::format("comes {} instead of {:.3g}", per_second(rate), *expected_hz_)));
  }
  if (periodic_ && configured_ && window_.size() >= kMinMessages && rate > limits_.fast_factor * *expected_hz_) {
    out.push_back(condition("fast", Verdict::kDegraded,
                            fmt::format("comes {} instead of {:.3g}", per_second(rate), *expected_hz_)));
  }
  const int64_t lost = lost_.within(now_us);
  const double of = std::max(1.0, expected_hz_.value_or(rate));
  if (periodic_ && static_cast<double>(lost) > limits_.lost_share * of) {
    out.push_back(condition("lost", Verdict::kDegraded, fmt::format("lost {} messages within a second", lost)));
  }
  if (run_changes_.within(now_us) >= kTwoPublishers) {
    out.push_back(condition("two_publishers", Verdict::kDegraded, "has two publishers at once"));
  }
}

void ChannelMonitor::check_stamps(int64_t now_us, int64_t lag_us, std::vector<Condition>& out) const {
  if (stamp_jumps_.within(now_us) > 0) {
    out.push_back(
        condition("stamp_jump", Verdict::kDegraded, fmt::format("has stamps that jumped by {:+.1f} s", stamp_jump_s_)));
  }
  const std::optional<int64_t> lag = this->lag_us();
  if (!lag || !is_fresh(now_us)) return;
  const double latency = seconds(*lag - lag_us);
  if (latency > limits_.latency) {
    out.push_back(condition(
        "late", Verdict::kDegraded,
        fmt::format("arrives {:.2f} s after its stamp; estimators wait {:.2f} s at most", latency, limits_.latency)));
  } else if (latency < -limits_.ahead) {
    out.push_back(condition("ahead", Verdict::kDegraded,
                            fmt::format("has stamps that are {:.2f} s ahead of the others", -latency)));
  }
}

void ChannelMonitor::check_contents(int64_t now_us, std::vector<Condition>& out) const {
  if (const int64_t count = undecodable_.within(now_us); count > 0) {
    out.push_back(condition("undecodable", Verdict::kDegraded,
                            fmt::format("has {} messages that cannot be read: {}", count, why_undecodable_)));
  }
  if (unusable_.within(now_us) > 0) {
    out.push_back(condition("unusable", Verdict::kDegraded, "sends values that are no numbers"));
  }
  if (content_ && content_messages_ >= limits_.frozen_messages && !silent(now_us) &&
      seconds(window_.back().now_us - content_since_us_) > limits_.frozen_after) {
    out.push_back(condition("frozen", Verdict::kDegraded, "repeats one and the same value: it is frozen"));
  }
}

ChannelReport ChannelMonitor::report(int64_t now_us, int64_t lag_us) const {
  ChannelReport report;
  report.name = name_;
  report.expected_hz = expected_hz_;
  report.received = received_;
  report.lost = lost_.total();
  report.undecodable = undecodable_.total();
  if (window_.empty()) return report;
  report.silent = silent(now_us);
  report.rate_hz = rate_hz(now_us);
  report.age_s = seconds(now_us - window_.back().now_us);
  if (const std::optional<int64_t> lag = this->lag_us()) report.latency_s = seconds(*lag - lag_us);
  report.jitter_s = jitter_s();
  return report;
}

}  // namespace roadfix
