/// The steps of an interacting multiple model filter, one free function each (Blom, Bar-Shalom, The interacting
/// multiple model algorithm, 1988; Bar-Shalom, Li, Kirubarajan, Estimation with applications to tracking and
/// navigation, 2001, section 11.6.6; Lee et al. (2025), section 3.2 and (7), (8)). Angles are mixed as angles; likelihoods stay
/// logarithms.
///
/// In order: mix, predict, any number of updates (each adds to log_likelihood), reweigh, combine.
#pragma once

#include <array>

#include "fusion/motion_model.h"
#include "fusion/planar.h"

namespace roadfix {

inline constexpr int kModes = 2;

struct Mode {
  MotionKind kind = MotionKind::kConstantAcceleration;
  FusionEstimate estimate;
  double log_likelihood = 0.0;  ///< of this step's measurements
};

struct Imm {
  std::array<Mode, kModes> modes{Mode{MotionKind::kConstantAcceleration, {}, 0.0},
                                 Mode{MotionKind::kConstantTurn, {}, 0.0}};
  Eigen::Vector2d probability = Eigen::Vector2d(0.5, 0.5);
};

/// Row i, column j: probability that mode i becomes mode j within dt, for the mean durations of the modes, s.
Eigen::Matrix2d mode_transition(double dt, const Eigen::Vector2d& mean_duration);

/// Interaction: each mode starts from the mixture of all, weighted by who may have become it; probabilities are
/// predicted. Log-likelihoods are zeroed.
void mix(Imm& imm, const Eigen::Matrix2d& transition);

/// Each mode by its own model. `before`: the poses that they moved from.
using PosesBefore = std::array<PoseBefore, kModes>;
void predict(Imm& imm, const MotionNoise& noise, double dt, PosesBefore* before = nullptr);

/// Probabilities by the likelihoods: log-sum-exp, so that they sum to one for likelihoods as small as they come.
void reweigh(Imm& imm);

/// Moments of the mixture, Lee et al. (2025), (7), (8).
void combine(const Imm& imm, FusionEstimate& combined);
inline FusionEstimate combine(const Imm& imm) {
  FusionEstimate combined;
  combine(imm, combined);
  return combined;
}

/// The same where the pose and the speed are all that is asked for.
struct PlanarMixture {
  PlanarEstimate planar;
  double speed = 0.0;  ///< m/s
};
PlanarMixture combine_planar(const Imm& imm);
/// m2, east and north together.
double place_variance(const Imm& imm);
/// Of one state.
double combined_variance(const Imm& imm, int index);

}  // namespace roadfix
