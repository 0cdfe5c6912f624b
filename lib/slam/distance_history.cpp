#include "slam/distance_history.h"

#include <algorithm>
#include <cmath>

#include "samples/samples.h"
#include "statistics/chance.h"

namespace roadfix {
namespace {

/// Speed change without samples, m/s2: firm braking is 4, ordinary driving below 1.5.
constexpr double kUnmeasuredAcceleration = 1.5;
/// Correlation time of the noise of successive samples, s (wheel encoders and filters smooth their speeds).
constexpr double kNoiseCorrelation_s = 0.1;
/// Below this speed, m/s, a car with unsigned speeds may have reversed.
constexpr double kReversalSpeed = 0.3;
/// Curvature of the tightest circle, 1/m, for the difference between forward and return path.
constexpr double kMaxCurvature = 1.0 / 7.5;
/// Comparison interval of two sources: velocity errors of a filter last for seconds, the scale of a tyre for a drive.
constexpr int64_t kComparison_us = 10'000'000;
/// Sigmas below which a speed counts as noise.

}  // namespace

double unmeasured_displacement(double dt_s) { return 0.5 * kUnmeasuredAcceleration * dt_s * dt_s; }

void DistanceHistory::add(const SpeedSample& sample) {
  if (!marks_.empty() && sample.t_us <= marks_.back().sample.t_us) return;
  double way = 0.0, path = 0.0;
  if (!marks_.empty()) {
    const Mark& last = marks_.back();
    const double speed = 0.5 * (last.sample.speed + sample.speed);
    const double dt_s = seconds_between(last.sample.t_us, sample.t_us);
    way = last.way + speed * dt_s;
    path = last.path + (std::abs(speed) > kChance * sample.sigma ? std::abs(speed) * dt_s : 0.0);
  }
  marks_.push_back({sample, way, path});
  while (marks_.front().sample.t_us < sample.t_us - kKept_us) marks_.pop_front();
}

double DistanceHistory::distance_at(int64_t t_us) const {
  const auto after = std::lower_bound(marks_.begin(), marks_.end(), t_us,
                                      [](const Mark& mark, int64_t t) { return mark.sample.t_us < t; });
  if (after == marks_.begin()) {
    return after->way - after->sample.speed * seconds_between(t_us, after->sample.t_us);
  }
  const Mark& before = *std::prev(after);
  const double dt_s = seconds_between(before.sample.t_us, t_us);
  if (after == marks_.end()) return before.way + before.sample.speed * dt_s;
  const double share = dt_s / seconds_between(before.sample.t_us, after->sample.t_us);
  const double speed = before.sample.speed + share * (after->sample.speed - before.sample.speed);
  return before.way + 0.5 * (before.sample.speed + speed) * dt_s;
}

double DistanceHistory::sigma_at(int64_t t_us) const {
  const auto after = std::lower_bound(marks_.begin(), marks_.end(), t_us,
                                      [](const Mark& mark, int64_t t) { return mark.sample.t_us < t; });
  double gap_s = 1e9;
  if (after != marks_.end()) gap_s = seconds_between(t_us, after->sample.t_us);
  if (after != marks_.begin()) gap_s = std::min(gap_s, seconds_between(std::prev(after)->sample.t_us, t_us));
  return unmeasured_displacement(gap_s);
}

/// Distance error due to a possible reversal, m, (S.7.4).
double DistanceHistory::reversal_sigma(int64_t begin_us, int64_t end_us) const {
  const auto before = [](const Mark& mark, int64_t t) { return mark.sample.t_us < t; };
  const auto first = std::lower_bound(marks_.begin(), marks_.end(), begin_us, before);
  const auto last = std::lower_bound(first, marks_.end(), end_us, before);
  if (first == last) return 0.0;
  const Mark& from = *first;
  const Mark& to = *std::prev(last);
  if (std::all_of(first, last, [](const Mark& mark) { return mark.sample.directed; })) {
    const double back = std::max(0.0, 0.5 * (to.path - from.path - std::abs(to.way - from.way)));
    return kMaxCurvature * back * back;
  }
  double most = 0.0;
  for (auto mark = first; mark != last; ++mark) {
    if (mark->sample.speed < kReversalSpeed) most = std::max(most, std::min(mark->way - from.way, to.way - mark->way));
  }
  return 2.0 * most;
}

std::optional<TravelledDistance> DistanceHistory::between(int64_t begin_us, int64_t end_us) const {
  if (marks_.empty() || begin_us < marks_.front().sample.t_us - kExtrapolation_us ||
      end_us > marks_.back().sample.t_us + kExtrapolation_us || begin_us > marks_.back().sample.t_us) {
    return std::nullopt;
  }
  const SpeedSample& last = marks_.back().sample;
  TravelledDistance travel;
  const double way = distance_at(end_us) - distance_at(begin_us);
  travel.distance = std::abs(way);
  travel.backwards = way < 0.0;
  travel.scale_std = last.scale_std;
  const double noise2 = last.sigma * last.sigma * kNoiseCorrelation_s * seconds_between(begin_us, end_us);
  const double a = sigma_at(begin_us), b = sigma_at(end_us);
  const double c = reversal_sigma(begin_us, end_us);
  travel.sigma = std::sqrt(noise2 + a * a + b * b + c * c);
  return travel;
}

std::optional<DistanceHistory::Span> DistanceHistory::span() const {
  if (marks_.empty()) return std::nullopt;
  return Span{marks_.front().sample.t_us, marks_.back().sample.t_us};
}

std::optional<TravelledDistance> rescaled_distance(const DistanceHistory& late, const DistanceHistory& early,
                                                   int64_t begin_us, int64_t end_us) {
  const auto known = late.span(), own = early.span();
  auto travel = early.between(begin_us, end_us);
  if (!known || !own || !travel) return std::nullopt;
  const int64_t to_us = known->last_us;
  const int64_t from_us = std::max({to_us - kComparison_us, known->first_us, own->first_us});
  const auto reference = late.between(from_us, to_us), compared = early.between(from_us, to_us);
  if (!reference || !compared || !(reference->distance > 0.0) || !(compared->distance > 0.0)) return std::nullopt;
  const double scale_std =
      std::hypot(reference->scale_std, reference->sigma / reference->distance, compared->sigma / compared->distance);
  if (!(scale_std < travel->scale_std)) return std::nullopt;
  const double scale = reference->distance / compared->distance;
  travel->distance *= scale;
  travel->sigma *= scale;
  travel->scale_std = scale_std;
  return travel;
}

}  // namespace roadfix
