/// How far off a second lap is, of the odometry and with its loops closed.
#pragma once

#include <array>
#include <cstdio>
#include <stdexcept>
#include <vector>

#include "evaluation/alignment.h"
#include "relative_motion.h"

namespace roadfix {

/// Index of the pose at which the second lap begins: back near where the first one led away; the number of poses without one.
inline size_t second_lap(const std::vector<Stamped>& poses) {
  constexpr int64_t kOnTheWay_us = 10'000'000;
  constexpr double kNear = 5.0, kAway = 50.0;  // m
  size_t begin = 0;
  while (begin < poses.size() && poses[begin].t_us - poses.front().t_us < kOnTheWay_us) ++begin;
  bool away = false;
  for (size_t i = begin; i < poses.size(); ++i) {
    const double distance = (poses[i].T_true.p - poses[begin].T_true.p).head<2>().norm();
    away = away || distance > kAway;
    if (away && distance < kNear) return i;
  }
  return poses.size();
}

/// Sum of squared horizontal errors from the pose `first` on: all of them aligned in yaw and place, or tied at the first pose.
inline double squares_from(const std::vector<Stamped>& poses, size_t first, SE3 Stamped::*estimate, bool tied) {
  std::vector<PosePair> pairs(poses.size());
  for (size_t i = 0; i < poses.size(); ++i) {
    pairs[i].estimate.T_frame_vehicle = poses[i].*estimate;
    pairs[i].reference.T_frame_vehicle = poses[i].T_true;
  }
  const auto S = tied ? tie(pairs.front()) : align(pairs, Alignment::kYaw);
  if (!S) throw std::runtime_error("the drive does not move");
  double sum = 0.0;
  for (size_t i = first; i < poses.size(); ++i)
    sum += (S->T * pairs[i].estimate.T_frame_vehicle.p - poses[i].T_true.p).head<2>().squaredNorm();
  return sum;
}

/// Sums of squared horizontal errors, m2: aligned, and tied at the first pose.
struct SecondLap {
  size_t poses = 0;
  std::array<double, 2> open{}, closed{};

  void add(const SecondLap& other) {
    poses += other.poses;
    for (size_t k = 0; k < open.size(); ++k) {
      open[k] += other.open[k];
      closed[k] += other.closed[k];
    }
  }
};

inline void print(const SecondLap& lap) {
  const auto rms = [&](double sum) { return std::sqrt(sum / static_cast<double>(std::max<size_t>(1, lap.poses))); };
  std::printf("second laps: open %.4f m, closed %.4f m; tied at the first pose: open %.4f m, closed %.4f m\n",
              rms(lap.open[0]), rms(lap.closed[0]), rms(lap.open[1]), rms(lap.closed[1]));
}

}  // namespace roadfix
