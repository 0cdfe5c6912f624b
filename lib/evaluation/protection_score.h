/// Errors against protection levels, in the words of EN 16803-1: misleading where an error is above its level,
/// available where the levels are within the alert limits, hazardous where both hold and an error is above its limit.
/// Counts of single drives can be added; the Stanford diagram is one BoundHistogram per axis.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "evaluation/bounds.h"
#include "evaluation/errors.h"

namespace roadfix {

inline constexpr std::size_t kProtectedAxes = 3;  ///< along, across, up

/// One published set of levels.
struct ProtectionSample {
  int64_t pose_us = 0;  ///< of the pose that is bounded
  std::vector<double> risk;
  std::vector<Eigen::Vector3d> level;  ///< m, along, across, up, one per risk; infinite where there is none
  Eigen::Vector3d alert_limit = Eigen::Vector3d::Zero();  ///< m
  bool usable = false;
};

/// Levels and the error that they are held against.
struct BoundedError {
  ProtectionSample levels;
  Eigen::Vector3d error = Eigen::Vector3d::Zero();  ///< m, along, across, up, magnitudes
};

struct RiskScore {
  double risk = 0.0;
  int64_t misleading = 0;                              ///< samples with an error above its level, in any axis
  std::array<int64_t, kProtectedAxes> by_axis{};       ///< likewise, each axis
  int64_t available = 0;                               ///< samples with all levels within the alert limits
  int64_t hazardous = 0;                               ///< of these, with an error above its alert limit
  Eigen::Vector3d median = Eigen::Vector3d::Zero();    ///< m, of the levels
  std::array<BoundHistogram, kProtectedAxes> diagram;  ///< error against level
};

struct ProtectionScore {
  int64_t samples = 0;            ///< with levels and a known error
  int64_t unbounded = 0;          ///< with a known error and a level that is infinite; not among the samples
  double independent = 0.0;       ///< samples over the time for which the errors stay alike, (5) of Sokal (1997)
  double interval_s = 0.0;        ///< median time between samples
  std::vector<RiskScore> risks;   ///< in the order published
  int64_t usable = 0;             ///< samples whose flag says so, bounded or not
  int64_t interruptions = 0;      ///< ends of stretches of usable samples: continuity
  double longest_misled_s = 0.0;  ///< longest stretch that is usable with an error above a level of the first risk
  Eigen::Vector3d error_p95 = Eigen::Vector3d::Zero();  ///< m, 95 % of the errors' magnitudes
  std::vector<BoundedError> series;                     ///< all samples, bounded or not, in order of time
};

/// Levels held against the error nearest in time, within 60 ms. The reference's own sigma widens the level as far as an
/// error of it can explain: level^2 + (k sigma)^2 with k the Gaussian's at the level's risk. Levels of other risks than
/// the first ones are left out. Nothing where none meet.
std::optional<ProtectionScore> protection_score(const std::vector<ProtectionSample>& levels,
                                                const std::vector<PoseError>& errors, double reference_sigma);

/// Events of which so many, among so many samples, come in stretches: the independent ones, rounded up.
int64_t independent_events(int64_t events, int64_t samples, double independent);

/// The risk that `events` in n independent samples leave possible at 95 %: 3/n where there was none (Hanley,
/// Lippman-Hand, If nothing goes wrong, is everything all right?, JAMA 1983; exact for any count: Garwood 1936).
double risk_bounded_at(int64_t events, double independent_samples);

}  // namespace roadfix
