#include "evaluation/modes.h"

#include <algorithm>
#include <cmath>

#include "geometry/euler.h"
#include "geometry/so3.h"

namespace roadfix {
namespace {

/// Below this speed the course of a noisy velocity is no measure of turning.
constexpr double kCourseSpeed = 2.0;
/// Yaw rates are differences over at least this time: quantised or noisy references would drown shorter ones.
constexpr int64_t kRateBase_us = 200'000;
constexpr int64_t kLongestBase_us = 2'500'000;

std::optional<double> heading(const Trajectory& reference, const Odometry& pose) {
  if (reference.has_attitude) return yaw_of(pose.T_frame_vehicle.q);
  if (!reference.has_velocity || pose.velocity.head<2>().norm() < kCourseSpeed) return std::nullopt;
  return std::atan2(pose.velocity.y(), pose.velocity.x());
}

}  // namespace

std::vector<std::pair<int64_t, double>> yaw_rates(const Trajectory& reference) {
  std::vector<std::pair<int64_t, double>> rates;
  const auto& poses = reference.poses;
  std::size_t back = 0;
  std::size_t ahead = 0;
  for (const Odometry& pose : poses) {
    while (back + 1 < poses.size() && poses[back + 1].t_us <= pose.t_us - kRateBase_us / 2) ++back;
    while (ahead + 1 < poses.size() && poses[ahead].t_us < pose.t_us + kRateBase_us / 2) ++ahead;
    const int64_t base_us = poses[ahead].t_us - poses[back].t_us;
    if (base_us < kRateBase_us / 2 || base_us > kLongestBase_us) continue;
    const auto a = heading(reference, poses[back]);
    const auto b = heading(reference, poses[ahead]);
    if (a && b) rates.emplace_back(pose.t_us, wrap_angle(*b - *a) / (static_cast<double>(base_us) * 1e-6));
  }
  return rates;
}

std::optional<ModeAccuracy> mode_accuracy(const std::vector<ModeSample>& modes, const Trajectory& reference,
                                          double threshold_radps) {
  const auto rates = yaw_rates(reference);
  const int64_t reach_us = default_max_gap_us(reference);
  int hits[2] = {0, 0};
  int counts[2] = {0, 0};
  for (const ModeSample& mode : modes) {
    auto nearest = std::lower_bound(rates.begin(), rates.end(), mode.t_us,
                                    [](const auto& rate, int64_t t_us) { return rate.first < t_us; });
    if (nearest != rates.begin() &&
        (nearest == rates.end() || mode.t_us - std::prev(nearest)->first < nearest->first - mode.t_us)) {
      --nearest;
    }
    if (nearest == rates.end() || std::abs(nearest->first - mode.t_us) > reach_us) continue;
    const bool turn = std::abs(nearest->second) > threshold_radps;
    const bool predicts_turn = mode.turn_probability > 0.5;
    ++counts[turn];
    if (turn == predicts_turn) ++hits[turn];
  }
  const int samples = counts[0] + counts[1];
  if (samples == 0) return std::nullopt;
  const auto percent = [](int part, int whole) { return whole == 0 ? 0.0 : 100.0 * part / whole; };
  ModeAccuracy out;
  out.threshold = threshold_radps;
  out.samples = samples;
  out.turns = counts[1];
  out.percent = percent(hits[0] + hits[1], samples);
  out.always_straight_percent = percent(counts[0], samples);
  const int classes = (counts[0] > 0) + (counts[1] > 0);
  out.balanced_percent = (percent(hits[0], counts[0]) + percent(hits[1], counts[1])) / classes;
  return out;
}

}  // namespace roadfix
