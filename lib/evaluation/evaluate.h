/// The whole evaluation of one drive: a reference, what may be scored of it, and one report per estimate. MODEL.md.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "evaluation/alignment.h"
#include "evaluation/availability.h"
#include "evaluation/covariance_consistency.h"
#include "evaluation/drift.h"
#include "evaluation/drive_facts.h"
#include "evaluation/errors.h"
#include "evaluation/modes.h"
#include "evaluation/outages.h"
#include "evaluation/protection_score.h"
#include "evaluation/slow_error.h"

namespace roadfix {

struct ReferenceFlags {
  bool may_score = true;
  bool withheld = false;  ///< from a fix that the estimators did not get
};

struct Reference {
  Trajectory trajectory;
  std::vector<ReferenceFlags> flags;  ///< one per pose
};

/// One estimate, in the reference's frame or in its own.
struct EstimateInput {
  std::string channel;
  Trajectory trajectory;
  bool local_frame = false;    ///< its own frame: absolute errors mean nothing without an alignment
  bool scale_unknown = false;  ///< lengths up to one factor
  Eigen::Vector3d lever_arm = Eigen::Vector3d::Zero();  ///< m, its own axes: from its point to the reference's
  std::vector<double> latencies;                        ///< s, from the time of validity to the time it was logged
  std::vector<ModeSample> modes;                        ///< of the fusion, else empty
  std::vector<ProtectionSample> protection;             ///< bounds published for it, in order of the poses' time
};

/// The error beyond which a pose helps nobody on a road; the monitor's limit for "do not use" (lib/health).
inline constexpr double kUsableWithin = 5.0;  // m

struct EvaluationOptions {
  std::optional<Alignment> alignment;  ///< none: by the estimate's frame (ENU: none; own: yaw; no scale: sim3)
  std::optional<int64_t> tie_us;       ///< of kTied; none: the last pair before the first outage
  bool fit_delay = false;              ///< the reference's constant latency is fitted first, within +-2 s
  double turn_threshold = 3.0 * 3.14159265358979323846 / 180.0;  ///< rad/s, of MPA
  double usable_within = kUsableWithin;                          ///< m, horizontally
  int rpe_stride = 100;                                          ///< samples, Lee et al. (2025)
  double slow_window = 0.0;  ///< s: the figures are also given without what of the error is slower (E.4.4); 0: not
};

struct AlignedAte {
  Alignment alignment = Alignment::kNone;
  double rmse = 0.0;             ///< m, as evo
  double mean = 0.0;             ///< m, as Lee et al. (2025)
  double horizontal_rmse = 0.0;  ///< m
  double scale = 1.0;
};

/// A point of the whole estimate after alignment, scored or not.
struct PathPoint {
  int64_t t_us = 0;
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  Validity validity = Validity::kInvalid;
};

struct ChannelScore {
  std::string channel;
  Alignment alignment = Alignment::kNone;
  Similarity similarity;
  double delay_s = 0.0;     ///< fitted: the reference lags the estimate by this
  int poses = 0;            ///< published
  int pairs = 0;            ///< scored
  double interval_s = 0.0;  ///< median time between scored pairs
  double duration_s = 0.0;
  double distance_m = 0.0;

  AxisErrors axes;
  double ate_rmse = 0.0;
  double ate_mean = 0.0;
  std::vector<AlignedAte> ate_by_alignment;
  std::optional<double> rpe_mean;         ///< m, Lee et al. (2025)
  std::optional<RelativeError> rpe_rmse;  ///< evo, over the samples of about one second
  std::optional<KittiDrift> kitti;
  std::optional<SlowlessFigures> slowless;  ///< as asked for
  OutageErrors outages;
  std::optional<double> tse_m;
  std::optional<Reconvergence> rct;
  std::optional<ModeAccuracy> modes;
  /// Of an estimate in its own frame: tied to the reference at its start, whatever the alignment; empty where the
  /// reference has neither attitude nor path enough for that.
  CovarianceConsistency consistency;
  Availability availability;
  std::optional<ProtectionScore>
      protection;                  ///< none where no bound was published, or the frame is not the reference's
  std::optional<double> usable;    ///< share of the time with a pose, valid or coasting, that is `usable_within` of the
                                   ///< truth; none where nothing is scored
  std::optional<Summary> latency;  ///< s

  std::string no_figures;  ///< why nothing is scored; empty where something is

  std::vector<PosePair> scored;  ///< after alignment
  std::vector<PoseError> errors;
  std::vector<SigmaSample> sigmas;
  std::vector<PathPoint> path;  ///< at most ten points a second
};

/// The time that counts: from skip_s after the first fix to the end of the reference.
std::pair<int64_t, int64_t> scored_time(const Reference& reference, const DriveFacts& facts);

ChannelScore evaluate_channel(const Reference& reference, const DriveFacts& facts, EstimateInput estimate,
                              const EvaluationOptions& options);

}  // namespace roadfix
