/// Figures about GNSS outages: errors at their ends, and Lee et al.'s (2025) TSE and RCT.
#pragma once

#include <optional>
#include <vector>

#include "evaluation/drive_facts.h"
#include "evaluation/errors.h"

namespace roadfix {

/// What counts as near a loss or a return, s, and as settled after a return, m.
inline constexpr double kTransition = 5.0;
inline constexpr double kSettled = 0.3;

/// Longer without an accepted fix is an outage, s.
inline constexpr double kLeastOutage = 2.0;

/// The outages of a recorded drive, from the times at which an estimator accepted a position fix, in order. The error of one
/// is that 0.2 s before the next fix.
std::vector<Outage> outages_between(const std::vector<int64_t>& accepted_us, double least_s = kLeastOutage);

struct OutageError {
  Outage outage;
  double duration_s = 0.0;    ///< from the first to the last withheld fix
  double distance_m = 0.0;    ///< path of the reference in it
  double horizontal_m = 0.0;  ///< error at the last withheld fix
  double vertical_m = 0.0;    ///< signed
  double norm_m = 0.0;
  std::optional<double> yaw_rad;
  std::optional<double> transition_peak_m;  ///< largest horizontal error within kTransition of the loss or the return
  std::optional<double> settle_s;  ///< from the return until the horizontal error is below kSettled; never: nothing
};

struct OutageErrors {
  std::vector<OutageError> each;
  int missing = 0;     ///< outages without estimate or reference at their end
  Summary horizontal;  ///< m
  Summary vertical;    ///< m
  double mean_distance_m = 0.0;
  double rms_percent = 0.0;  ///< RMS of the horizontal error over the distance driven in the outage
  double median_percent = 0.0;
};

/// Both trajectories in one frame and of one point; `errors` are those of the scored pairs. Outages in which the
/// reference stands still have no percentage.
OutageErrors outage_errors(const Trajectory& estimate, const Trajectory& reference, const std::vector<Outage>& outages,
                           const std::vector<PoseError>& errors, const ReferenceKind& kind);

/// TSE of Lee et al. (2025), (11): mean over the transitions of the largest error within half_width_s of each loss and each
/// return. Nothing without a transition among the errors.
std::optional<double> transition_stability(const std::vector<PoseError>& errors, const std::vector<Outage>& outages,
                                           double half_width_s = kTransition);

struct Reconvergence {
  double mean_s = 0.0;       ///< RCT
  double threshold_m = 0.0;  ///< 1.1 times the mean ATE
  int returns = 0;
  int never = 0;  ///< returns after which the error stays above until the next loss or the end; not in the mean
};

/// RCT of Lee et al. (2025), (12): time from each return until the error is below 1.1 times the mean ATE.
std::optional<Reconvergence> reconvergence(const std::vector<PoseError>& errors, const std::vector<Outage>& outages);

}  // namespace roadfix
