#include "evaluation/turns.h"

#include <algorithm>
#include <cmath>

#include "evaluation/modes.h"
#include "geometry/so3.h"

namespace roadfix {
namespace {

constexpr int64_t kPause_us = 1'000'000;   ///< within one turn
constexpr int64_t kAround_us = 1'000'000;  ///< before and after a turn, where the angle is read
constexpr int64_t kNear_us = 300'000;      ///< a few poses of 10 Hz

const PoseError* nearest(const std::vector<PoseError>& errors, int64_t t_us) {
  const auto later =
      std::lower_bound(errors.begin(), errors.end(), t_us, [](const PoseError& e, int64_t t) { return e.t_us < t; });
  const PoseError* best = nullptr;
  for (auto it = later == errors.begin() ? later : std::prev(later); it != errors.end() && it <= later; ++it) {
    if (std::abs(it->t_us - t_us) > kNear_us) continue;
    if (best == nullptr || std::abs(it->t_us - t_us) < std::abs(best->t_us - t_us)) best = &*it;
  }
  return best;
}

}  // namespace

std::vector<VehicleTurn> vehicle_turns(const Trajectory& reference, double threshold, double least) {
  std::vector<VehicleTurn> turns;
  const std::vector<std::pair<int64_t, double>> rates = yaw_rates(reference);
  for (std::size_t i = 1; i < rates.size(); ++i) {
    const auto [t_us, rate] = rates[i];
    if (std::abs(rate) <= threshold) continue;
    const double angle = rate * seconds_between(rates[i - 1].first, t_us);
    const bool same = !turns.empty() && t_us - turns.back().end_us <= kPause_us && turns.back().angle * rate > 0.0;
    if (!same) turns.push_back({rates[i - 1].first, t_us, 0.0});
    turns.back().end_us = t_us;
    turns.back().angle += angle;
  }
  std::erase_if(turns, [&](const VehicleTurn& turn) { return std::abs(turn.angle) < least; });
  return turns;
}

std::optional<double> turn_error(const std::vector<PoseError>& errors, const VehicleTurn& turn) {
  const PoseError* before = nearest(errors, turn.begin_us - kAround_us);
  const PoseError* after = nearest(errors, turn.end_us + kAround_us);
  if (before == nullptr || after == nullptr) return std::nullopt;
  return wrap_angle(after->angles.z() - before->angles.z());
}

}  // namespace roadfix
