#include "slam/travel.h"

#include <algorithm>
#include <cmath>

#include "samples/samples.h"
#include "slam/state_io.h"

namespace roadfix {
namespace {

/// What a car's speed does in a time without samples, m/s2: firm braking is 4, ordinary driving below 1.5.
constexpr double kUnseenAcceleration = 1.5;
/// Noise of neighbouring samples is alike over this time, s (wheel encoders and filters alike smooth their speeds).
constexpr double kNoiseCorrelation_s = 0.1;
/// Slower than this a car without signs may have changed its direction, m/s.
constexpr double kMayTurnBack = 0.3;
/// Of the tightest circle, 1/m: by what a way back differs from the way there.
constexpr double kTightest = 1.0 / 7.5;
/// Over which two sources are compared: a filter's velocity error lasts for seconds, a tyre's scale for a drive.
constexpr int64_t kCompared_us = 10'000'000;
/// Sigmas below which a speed may be noise.
constexpr double kNoise = 3.0;

}  // namespace

void TravelHistory::add(const SpeedSample& sample) {
  if (!marks_.empty() && sample.t_us <= marks_.back().sample.t_us) return;
  double way = 0.0, path = 0.0;
  if (!marks_.empty()) {
    const Mark& last = marks_.back();
    const double speed = 0.5 * (last.sample.speed + sample.speed);
    const double dt_s = seconds_between(last.sample.t_us, sample.t_us);
    way = last.way + speed * dt_s;
    path = last.path + (std::abs(speed) > kNoise * sample.sigma ? std::abs(speed) * dt_s : 0.0);
  }
  marks_.push_back({sample, way, path});
  while (marks_.front().sample.t_us < sample.t_us - kKept_us) marks_.pop_front();
}

double TravelHistory::way_at(int64_t t_us) const {
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

double TravelHistory::doubt_at(int64_t t_us) const {
  const auto after = std::lower_bound(marks_.begin(), marks_.end(), t_us,
                                      [](const Mark& mark, int64_t t) { return mark.sample.t_us < t; });
  double gap_s = 1e9;
  if (after != marks_.end()) gap_s = seconds_between(t_us, after->sample.t_us);
  if (after != marks_.begin()) gap_s = std::min(gap_s, seconds_between(std::prev(after)->sample.t_us, t_us));
  return 0.5 * kUnseenAcceleration * gap_s * gap_s;
}

/// What a change of direction in between makes of the distance, m, (M.8c).
double TravelHistory::turned_back(int64_t begin_us, int64_t end_us) const {
  const auto before = [](const Mark& mark, int64_t t) { return mark.sample.t_us < t; };
  const auto first = std::lower_bound(marks_.begin(), marks_.end(), begin_us, before);
  const auto last = std::lower_bound(first, marks_.end(), end_us, before);
  if (first == last) return 0.0;
  const Mark& from = *first;
  const Mark& to = *std::prev(last);
  if (std::all_of(first, last, [](const Mark& mark) { return mark.sample.directed; })) {
    const double back = std::max(0.0, 0.5 * (to.path - from.path - std::abs(to.way - from.way)));
    return kTightest * back * back;
  }
  double most = 0.0;
  for (auto mark = first; mark != last; ++mark) {
    if (mark->sample.speed < kMayTurnBack) most = std::max(most, std::min(mark->way - from.way, to.way - mark->way));
  }
  return 2.0 * most;
}

std::optional<Travel> TravelHistory::between(int64_t begin_us, int64_t end_us) const {
  if (marks_.empty() || begin_us < marks_.front().sample.t_us - kReach_us ||
      end_us > marks_.back().sample.t_us + kReach_us || begin_us > marks_.back().sample.t_us) {
    return std::nullopt;
  }
  const SpeedSample& last = marks_.back().sample;
  Travel travel;
  const double way = way_at(end_us) - way_at(begin_us);
  travel.distance = std::abs(way);
  travel.backwards = way < 0.0;
  travel.scale_std = last.scale_std;
  const double noise2 = last.sigma * last.sigma * kNoiseCorrelation_s * seconds_between(begin_us, end_us);
  const double a = doubt_at(begin_us), b = doubt_at(end_us);
  const double c = turned_back(begin_us, end_us);
  travel.sigma = std::sqrt(noise2 + a * a + b * b + c * c);
  return travel;
}

std::optional<TravelHistory::Span> TravelHistory::span() const {
  if (marks_.empty()) return std::nullopt;
  return Span{marks_.front().sample.t_us, marks_.back().sample.t_us};
}

std::optional<Travel> in_scale_of(const TravelHistory& late, const TravelHistory& early, int64_t begin_us,
                                  int64_t end_us) {
  const auto known = late.span(), own = early.span();
  auto travel = early.between(begin_us, end_us);
  if (!known || !own || !travel) return std::nullopt;
  const int64_t to_us = known->last_us;
  const int64_t from_us = std::max({to_us - kCompared_us, known->first_us, own->first_us});
  const auto right = late.between(from_us, to_us), told = early.between(from_us, to_us);
  if (!right || !told || !(right->distance > 0.0) || !(told->distance > 0.0)) return std::nullopt;
  const double scale_std = std::hypot(right->scale_std, right->sigma / right->distance, told->sigma / told->distance);
  if (!(scale_std < travel->scale_std)) return std::nullopt;
  const double scale = right->distance / told->distance;
  travel->distance *= scale;
  travel->sigma *= scale;
  travel->scale_std = scale_std;
  return travel;
}

void TravelHistory::save(StateWriter& writer) const { SavingArchive{writer}(marks_); }

void TravelHistory::load(StateReader& reader) { LoadingArchive{reader}(marks_); }

}  // namespace roadfix
