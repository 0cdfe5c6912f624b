#include "health/nis_monitor.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

namespace roadfix {

namespace {

/// A slow source is checked over this many, however old, up to the age below.
constexpr std::size_t kMinMeasurements = 5;
constexpr int64_t kOldestNis_us = 10'000'000;
constexpr std::size_t kMaxMeasurements = 1000;
/// Degrees of freedom below which a mean is too uncertain: at 10 a ratio of 5 is a chance of 1e-7.
constexpr int kMinDof = 10;
constexpr int kMinRefused = 3;
/// All refused for this long: reported before they are most of the window. A wheel that is stuck contradicts the
/// estimate only half a second later, and the verdict is due within one.
constexpr int64_t kConsecutive_us = 250'000;
/// Of NIS to degrees of freedom, up to which a measurement that is not used does not contradict the estimate: no gate
/// is that narrow (95 % lie at 2.1 for six of them, at more for fewer). An estimator waits until a source that was
/// wrong has fitted for a while before it uses it again.
constexpr double kConsistentRatio = 2.0;
/// After the newest refusal a fast source is well again.
constexpr int64_t kStillRefused_us = 500'000;
/// And any source after this many in a row that fit, used or not, over kConsecutive_us: a map that is young errs now
/// and then, so that the intervals between refusals do not predict when the next is due.
constexpr int kRecoveredFits = 5;

}  // namespace

void NisMonitor::add(int64_t now_us, double nis, int dof, bool accepted) {
  if (!std::isfinite(nis) || dof <= 0) return;
  const bool fits = accepted || nis <= kConsistentRatio * dof;
  consecutive_fits_ = fits ? consecutive_fits_ + 1 : 0;
  if (!fits) refused_us_ = now_us;
  if (fits && !accepted) return;
  measurements_.push_back({now_us, nis, dof, accepted});
  while (measurements_.size() > kMaxMeasurements || now_us - measurements_.front().now_us > kOldestNis_us)
    measurements_.pop_front();
}

std::vector<NisMonitor::Measurement> NisMonitor::window(int64_t now_us) const {
  const auto window_us = std::llround(limits_.window * 1e6);
  std::vector<Measurement> recent;
  for (auto measurement = measurements_.rbegin(); measurement != measurements_.rend(); ++measurement) {
    const int64_t age_us = now_us - measurement->now_us;
    if (age_us > kOldestNis_us || (age_us > window_us && recent.size() >= kMinMeasurements)) break;
    recent.push_back(*measurement);
  }
  return recent;
}

NisReport NisMonitor::report(int64_t now_us) const {
  NisReport report;
  report.source = source_;
  double sum = 0.0;
  int dof = 0;
  for (const Measurement& measurement : window(now_us)) {
    if (!measurement.accepted) {
      ++report.refused;
      continue;
    }
    ++report.used;
    sum += measurement.nis;
    dof += measurement.dof;
  }
  if (dof > 0) report.ratio = sum / dof;
  return report;
}

bool NisMonitor::refused_consecutively(int64_t now_us) const {
  if (measurements_.empty() || now_us - measurements_.back().now_us > std::llround(limits_.window * 1e6)) return false;
  int count = 0;
  int64_t since_us = 0;
  for (auto measurement = measurements_.rbegin(); measurement != measurements_.rend() && !measurement->accepted;
       ++measurement) {
    ++count;
    since_us = measurement->now_us;
  }
  return count >= kMinRefused && measurements_.back().now_us - since_us >= kConsecutive_us;
}

/// Whether refusals are still going on: the newest is no older than a few attempts would be. What came before a source
/// fell silent, or was accepted again, is over.
bool NisMonitor::is_still_refused(int64_t now_us) const {
  if (consecutive_fits_ >= kRecoveredFits && now_us - refused_us_ >= kConsecutive_us) return false;
  std::vector<int64_t> intervals_us;
  std::optional<int64_t> refused_us;
  const std::vector<Measurement> recent = window(now_us);  // newest first
  for (std::size_t i = 0; i < recent.size(); ++i) {
    if (i > 0) intervals_us.push_back(recent[i - 1].now_us - recent[i].now_us);
    if (!recent[i].accepted && !refused_us) refused_us = recent[i].now_us;
  }
  if (!refused_us || intervals_us.empty()) return refused_us.has_value();
  const auto middle = intervals_us.begin() + static_cast<std::ptrdiff_t>(intervals_us.size() / 2);
  std::nth_element(intervals_us.begin(), middle, intervals_us.end());
  return now_us - *refused_us <= std::max(kStillRefused_us, 5 * *middle / 2);
}

void NisMonitor::check(int64_t now_us, std::vector<Condition>& out) const {
  const NisReport r = report(now_us);
  int dof = 0;
  for (const Measurement& measurement : window(now_us)) dof += measurement.accepted ? measurement.dof : 0;
  if (dof >= kMinDof && r.ratio > limits_.nis_ratio) {
    out.push_back({"nis." + source_, Verdict::kDegraded, kRankConsistency,
                   fmt::format("{} fits worse than it claims: squared errors are {:.1f} times what they should be",
                               source_, r.ratio)});
  }
  const bool most = r.refused >= kMinRefused && r.refused > limits_.refused_share * (r.used + r.refused);
  if ((most || refused_consecutively(now_us)) && is_still_refused(now_us)) {
    out.push_back({"refused." + source_, Verdict::kDegraded, kRankConsistency,
                   fmt::format("{} is refused: {} of the last {} contradict the estimate", source_, r.refused,
                               r.used + r.refused)});
  }
}

}  // namespace roadfix
