/// Absolute and relative figures of whole trajectories, each as its source defines it; never compared with each other.
#pragma once

#include <optional>
#include <vector>

#include "evaluation/errors.h"

namespace roadfix {

/// ATE as `evo_ape` computes it: root mean square of the position errors' norms.
double ate_rmse(const std::vector<PoseError>& errors);
/// ATE of Lee et al. (2025), (9): mean of the position errors' norms.
double ate_mean(const std::vector<PoseError>& errors);

/// RPE of Lee et al. (2025), (10): mean norm of the difference between the displacements over `stride` samples, both in the
/// common frame; translation only. Nothing with fewer than stride + 1 pairs.
std::optional<double> rpe_mean(const std::vector<PosePair>& pairs, int stride = 100);

struct RelativeError {
  int delta = 0;                  ///< samples
  double translation_rmse = 0.0;  ///< m
  double rotation_rmse = 0.0;     ///< rad
};

/// RPE as `evo_rpe --delta N --delta_unit f` computes it: consecutive pairs i, i + delta, i + 2 delta and so on;
/// (Q_i^-1 Q_j)^-1 (P_i^-1 P_j); RMSE. Needs attitude in both.
std::optional<RelativeError> rpe_rmse(const std::vector<PosePair>& pairs, int delta);

struct KittiDrift {
  double translation_percent = 0.0;    ///< t_rel
  double rotation_deg_per_100m = 0.0;  ///< r_rel
  int segments = 0;
  std::vector<std::pair<int, double>> per_length;  ///< segment length m, translation %
};

/// Drift of the KITTI odometry benchmark (Geiger, Lenz, Urtasun, CVPR 2012): segments of 100 to 800 m of reference
/// path, relative pose error over length, averaged over all segments. A segment starts at every pair; the benchmark's
/// own kit takes every tenth (start_step 10: 0.70 % in place of 0.71 for ORB-SLAM on KITTI 00). Needs attitude in both;
/// nothing where the path is below 100 m.
std::optional<KittiDrift> kitti_drift(const std::vector<PosePair>& pairs, int start_step = 1);

}  // namespace roadfix
