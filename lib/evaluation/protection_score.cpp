#include "evaluation/protection_score.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "statistics/chi_square.h"
#include "statistics/summary.h"

namespace roadfix {
namespace {

constexpr int64_t kNear_us = 60'000;
constexpr double kGap_s = 1.0;           // a stretch ends where nothing was published for longer
constexpr double kWindow = 6.0;          // of Sokal's automatic window, autocorrelation times
constexpr std::size_t kMostLags = 3000;  // 5 min at 10 Hz

struct Scored {
  const ProtectionSample* sample = nullptr;
  Eigen::Vector3d error = Eigen::Vector3d::Zero();
};

std::vector<Scored> scored_samples(const std::vector<ProtectionSample>& levels, const std::vector<PoseError>& errors) {
  std::vector<Scored> scored;
  std::size_t next = 0;
  for (const ProtectionSample& sample : levels) {
    if (sample.risk != levels.front().risk || sample.level.size() != sample.risk.size()) continue;
    const auto away = [&](std::size_t i) { return std::abs(errors[i].t_us - sample.pose_us); };
    while (next + 1 < errors.size() && away(next + 1) <= away(next)) ++next;
    if (errors.empty() || away(next) > kNear_us) continue;
    scored.push_back({&sample, errors[next].position_vehicle.cwiseAbs()});
  }
  return scored;
}

bool bounded(const ProtectionSample& sample) {
  return !sample.level.empty() &&
         std::ranges::all_of(sample.level, [](const Eigen::Vector3d& l) { return l.allFinite(); });
}

Eigen::Vector3d widened(const Eigen::Vector3d& level, double risk, double reference_sigma) {
  const double k = normal_quantile(1.0 - risk / (2.0 * kProtectedAxes));
  return (level.cwiseAbs2().array() + k * k * reference_sigma * reference_sigma).sqrt();
}

/// Integrated autocorrelation time in samples, summed up to kWindow of itself: Sokal, Monte Carlo Methods in
/// Statistical Mechanics (1997), section 3.
double correlation_time(const std::vector<double>& x) {
  const double m = mean(x);
  double variance = 0.0;
  for (const double v : x) variance += (v - m) * (v - m);
  if (!(variance > 0.0)) return static_cast<double>(x.size());
  double time = 1.0;
  for (std::size_t lag = 1; lag < std::min(x.size() / 2, kMostLags); ++lag) {
    double product = 0.0;
    for (std::size_t i = lag; i < x.size(); ++i) product += (x[i] - m) * (x[i - lag] - m);
    time += 2.0 * product / variance;
    if (static_cast<double>(lag) >= kWindow * time) break;
  }
  return std::clamp(time, 1.0, static_cast<double>(x.size()));
}

void score_risk(const std::vector<Scored>& scored, std::size_t r, double reference_sigma, ProtectionScore& out) {
  RiskScore& score = out.risks.emplace_back();
  score.risk = scored.front().sample->risk[r];
  std::array<std::vector<double>, kProtectedAxes> levels;
  for (const Scored& s : scored) {
    if (!bounded(*s.sample)) continue;
    const Eigen::Vector3d& published = s.sample->level[r];
    const Eigen::Vector3d level = widened(published, score.risk, reference_sigma);
    for (std::size_t a = 0; a < kProtectedAxes; ++a) {
      const auto axis = static_cast<Eigen::Index>(a);
      score.diagram[a].add(s.error(axis), level(axis));
      score.by_axis[a] += s.error(axis) > level(axis) ? 1 : 0;
      levels[a].push_back(published(axis));
    }
    score.misleading += (s.error.array() > level.array()).any() ? 1 : 0;
    if ((published.array() > s.sample->alert_limit.array()).any()) continue;
    ++score.available;
    score.hazardous += (s.error.array() > s.sample->alert_limit.array()).any() ? 1 : 0;
  }
  for (std::size_t a = 0; a < kProtectedAxes; ++a) score.median(static_cast<Eigen::Index>(a)) = median(levels[a]);
}

/// Of the errors over their levels, the slowest axis.
double independent_samples(const std::vector<Scored>& scored) {
  double slowest = 1.0;
  std::size_t count = 0;
  for (Eigen::Index axis = 0; axis < static_cast<Eigen::Index>(kProtectedAxes); ++axis) {
    std::vector<double> ratios;
    for (const Scored& s : scored)
      if (bounded(*s.sample)) ratios.push_back(s.error(axis) / s.sample->level.front()(axis));
    count = ratios.size();
    if (count > 1) slowest = std::max(slowest, correlation_time(ratios));
  }
  return static_cast<double>(count) / slowest;
}

void score_stretches(const std::vector<Scored>& scored, double reference_sigma, ProtectionScore& out) {
  const Scored* last = nullptr;
  int64_t misled_since_us = 0;
  bool misled = false;
  for (const Scored& s : scored) {
    const bool gap = last != nullptr && seconds_between(last->sample->pose_us, s.sample->pose_us) > kGap_s;
    if (last != nullptr && last->sample->usable && (gap || !s.sample->usable)) ++out.interruptions;
    out.usable += s.sample->usable ? 1 : 0;
    const Eigen::Vector3d level = widened(s.sample->level.front(), s.sample->risk.front(), reference_sigma);
    const bool now = s.sample->usable && (s.error.array() > level.array()).any();
    if (now && (!misled || gap)) misled_since_us = s.sample->pose_us;
    misled = now;
    if (now) {
      const double lasted = seconds_between(misled_since_us, s.sample->pose_us) + out.interval_s;
      out.longest_misled_s = std::max(out.longest_misled_s, lasted);
    }
    last = &s;
  }
}

}  // namespace

std::optional<ProtectionScore> protection_score(const std::vector<ProtectionSample>& levels,
                                                const std::vector<PoseError>& errors, double reference_sigma) {
  const std::vector<Scored> scored = scored_samples(levels, errors);
  if (scored.empty()) return std::nullopt;
  ProtectionScore out;
  out.samples = std::ranges::count_if(scored, [](const Scored& s) { return bounded(*s.sample); });
  out.unbounded = static_cast<int64_t>(scored.size()) - out.samples;
  std::vector<double> intervals;
  for (std::size_t i = 1; i < scored.size(); ++i)
    intervals.push_back(seconds_between(scored[i - 1].sample->pose_us, scored[i].sample->pose_us));
  out.interval_s = median(intervals);
  for (std::size_t r = 0; r < scored.front().sample->risk.size(); ++r) score_risk(scored, r, reference_sigma, out);
  out.independent = independent_samples(scored);
  score_stretches(scored, reference_sigma, out);
  for (const Scored& s : scored) out.series.push_back({*s.sample, s.error});
  for (Eigen::Index axis = 0; axis < static_cast<Eigen::Index>(kProtectedAxes); ++axis) {
    std::vector<double> magnitudes;
    for (const Scored& s : scored) magnitudes.push_back(s.error(axis));
    out.error_p95(axis) = quantile(magnitudes, 0.95);
  }
  return out;
}

int64_t independent_events(int64_t events, int64_t samples, double independent) {
  if (events == 0 || samples == 0) return 0;
  return static_cast<int64_t>(std::ceil(static_cast<double>(events) * independent / static_cast<double>(samples)));
}

double risk_bounded_at(int64_t events, double independent_samples) {
  if (!(independent_samples > 0.0)) return 1.0;
  const double limit = 0.5 * chi_square_quantile(0.95, 2.0 * static_cast<double>(events + 1));
  return std::min(1.0, limit / independent_samples);
}

}  // namespace roadfix
