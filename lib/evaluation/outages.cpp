#include "evaluation/outages.h"

#include <algorithm>
#include <cmath>

#include "evaluation/drift.h"

namespace roadfix {
namespace {

/// Lee et al. (2025), section 4.3.2: "1.1 times the mean ATE".
constexpr double kReconvergenceFactor = 1.1;
/// Below this path an outage is standing still and an error in percent of it means nothing.
constexpr double kStandstill_m = 1.0;
/// By which the end of an outage that was found lies before the fix that ended it: the estimate there has none of it.
constexpr int64_t kBeforeReturn_us = 200'000;

double path_between(const Trajectory& reference, int64_t begin_us, int64_t end_us) {
  double length = 0.0;
  const Odometry* last = nullptr;
  for (const Odometry& pose : reference.poses) {
    if (pose.t_us < begin_us || pose.t_us > end_us) continue;
    if (last != nullptr) length += (pose.T_frame_vehicle.p - last->T_frame_vehicle.p).norm();
    last = &pose;
  }
  return length;
}

bool within(int64_t t_us, int64_t centre_us, double half_width_s) {
  return std::abs(seconds_between(centre_us, t_us)) <= half_width_s;
}

std::optional<double> transition_peak(const std::vector<PoseError>& errors, const Outage& outage) {
  std::optional<double> peak;
  for (const PoseError& e : errors) {
    if (!within(e.t_us, outage.first_withheld_us, kTransition) && !within(e.t_us, outage.return_us, kTransition))
      continue;
    peak = std::max(peak.value_or(0.0), e.horizontal());
  }
  return peak;
}

std::optional<double> settling_time(const std::vector<PoseError>& errors, const Outage& outage) {
  const auto settled = std::find_if(errors.begin(), errors.end(), [&](const PoseError& e) {
    return e.t_us >= outage.return_us && e.horizontal() < kSettled;
  });
  if (settled == errors.end()) return std::nullopt;
  return seconds_between(outage.return_us, settled->t_us);
}

OutageError error_at_end(const PosePair& end, const Outage& outage, const Trajectory& reference,
                         const ReferenceKind& kind) {
  const PoseError error = pose_error(end, kind);
  OutageError o;
  o.outage = outage;
  o.duration_s = seconds_between(outage.first_withheld_us, outage.last_withheld_us);
  o.distance_m = path_between(reference, outage.first_withheld_us, outage.last_withheld_us);
  o.horizontal_m = error.horizontal();
  o.vertical_m = error.position_frame.z();
  o.norm_m = error.norm();
  if (kind.attitude) o.yaw_rad = error.angles.z();
  return o;
}

}  // namespace

std::vector<Outage> outages_between(const std::vector<int64_t>& accepted_us, double least_s) {
  std::vector<Outage> outages;
  for (std::size_t i = 1; i < accepted_us.size(); ++i) {
    if (seconds_between(accepted_us[i - 1], accepted_us[i]) <= least_s) continue;
    outages.push_back({accepted_us[i - 1] + 1, accepted_us[i] - kBeforeReturn_us, accepted_us[i]});
  }
  return outages;
}

OutageErrors outage_errors(const Trajectory& estimate, const Trajectory& reference, const std::vector<Outage>& outages,
                           const std::vector<PoseError>& errors, const ReferenceKind& kind) {
  OutageErrors out;
  std::vector<double> horizontal;
  std::vector<double> vertical;
  std::vector<double> percent;
  for (const Outage& outage : outages) {
    const auto e = interpolate(estimate, outage.last_withheld_us, default_max_gap_us(estimate));
    const auto r = interpolate(reference, outage.last_withheld_us, default_max_gap_us(reference));
    if (!e || !r || e->validity == Validity::kInvalid) {
      ++out.missing;
      continue;
    }
    OutageError o = error_at_end({*e, *r}, outage, reference, kind);
    o.transition_peak_m = transition_peak(errors, outage);
    o.settle_s = settling_time(errors, outage);
    out.each.push_back(o);
    horizontal.push_back(o.horizontal_m);
    vertical.push_back(o.vertical_m);
    out.mean_distance_m += o.distance_m;
    if (o.distance_m > kStandstill_m) percent.push_back(100.0 * o.horizontal_m / o.distance_m);
  }
  out.horizontal = summarise(horizontal);
  out.vertical = summarise(vertical);
  out.rms_percent = root_mean_square(percent);
  out.median_percent = median(percent);
  if (!out.each.empty()) out.mean_distance_m /= static_cast<double>(out.each.size());
  return out;
}

std::optional<double> transition_stability(const std::vector<PoseError>& errors, const std::vector<Outage>& outages,
                                           double half_width_s) {
  std::vector<double> peaks;
  for (const Outage& outage : outages) {
    for (const int64_t transition_us : {outage.first_withheld_us, outage.return_us}) {
      std::optional<double> peak;
      for (const PoseError& e : errors) {
        if (within(e.t_us, transition_us, half_width_s)) peak = std::max(peak.value_or(0.0), e.norm());
      }
      if (peak) peaks.push_back(*peak);
    }
  }
  if (peaks.empty()) return std::nullopt;
  return mean(peaks);
}

std::optional<Reconvergence> reconvergence(const std::vector<PoseError>& errors, const std::vector<Outage>& outages) {
  Reconvergence out;
  out.threshold_m = kReconvergenceFactor * ate_mean(errors);
  std::vector<double> times;
  for (std::size_t i = 0; i < outages.size(); ++i) {
    const int64_t return_us = outages[i].return_us;
    const int64_t end_us = i + 1 < outages.size() ? outages[i + 1].first_withheld_us : INT64_MAX;
    const auto first =
        std::find_if(errors.begin(), errors.end(), [&](const PoseError& e) { return e.t_us >= return_us; });
    if (first == errors.end() || first->t_us >= end_us) continue;
    ++out.returns;
    const auto below = std::find_if(first, errors.end(),
                                    [&](const PoseError& e) { return e.t_us >= end_us || e.norm() < out.threshold_m; });
    if (below == errors.end() || below->t_us >= end_us) {
      ++out.never;
    } else {
      times.push_back(seconds_between(return_us, below->t_us));
    }
  }
  if (out.returns == 0) return std::nullopt;
  out.mean_s = mean(times);
  return out;
}

}  // namespace roadfix
