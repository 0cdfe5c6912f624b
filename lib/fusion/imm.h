/// The steps of an interacting multiple model filter, one free function each (Blom, Bar-Shalom, The interacting
/// multiple model algorithm, 1988; Bar-Shalom, Li, Kirubarajan, Estimation with applications to tracking and
/// navigation, 2001, section 11.6.6; Lee et al. (2025), section 3.2 and (7), (8)). Angles are mixed as angles;
/// likelihoods stay logarithms.
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
  template <class Self, class Visitor>
  static void visit_members(Self& self, const Visitor& visit) {
    visit(self.kind, self.estimate, self.log_likelihood);
  }
};

struct Imm {
  std::array<Mode, kModes> modes{Mode{MotionKind::kConstantAcceleration, {}, 0.0},
                                 Mode{MotionKind::kConstantTurn, {}, 0.0}};
  Eigen::Vector2d probability = Eigen::Vector2d(0.5, 0.5);
  template <class Self, class Visitor>
  static void visit_members(Self& self, const Visitor& visit) {
    visit(self.modes, self.probability);
  }
};

struct ModeDurations {
  double straight = 10.0;  ///< s, mean duration
  double turn = 4.0;       ///< s
};

template <class Visitor>
void visit(ModeDurations& c, Visitor& v) {
  v.number("straight_s", c.straight, 0.01, 1e4);
  v.number("turn_s", c.turn, 0.01, 1e4);
}

/// Row i, column j: probability that mode i becomes mode j within dt.
Eigen::Matrix2d mode_transition(double dt, const ModeDurations& durations);

/// Interaction: each mode starts from the mixture of all, weighted by who may have become it (F.2.6); probabilities
/// are predicted. Log-likelihoods are zeroed.
void mix(Imm& imm, const Eigen::Matrix2d& transition);

/// Each mode by its own model.
void predict(Imm& imm, const MotionNoise& noise, double dt);

/// mix() and predict() over `dt`, in steps that the models are good for.
void advance(Imm& imm, const ModeDurations& durations, const MotionNoise& noise, double dt);

/// Probabilities by the likelihoods, (F.2.7): log-sum-exp, so that they sum to one for likelihoods as small as they
/// come.
void reweigh(Imm& imm);

/// Moments of the mixture, Lee et al. (2025), (7), (8).
FusionEstimate combine(const Imm& imm);

/// What the modes' innovations were in the mean.
struct PoseInnovation {
  double nis = 0.0;
  Eigen::Vector3d innovation = Eigen::Vector3d::Zero();
  Eigen::Vector3d variance = Eigen::Vector3d::Zero();
};
/// The innovation of a pose against the combined estimate; nothing changes.
PoseInnovation judge_pose(const FusionEstimate& e, const Planar& pose, const Eigen::Matrix3d& R);
/// Lee et al. (2025), (5), (6): a pose as a pseudo-measurement of position and yaw.
void update_pose(Imm& imm, const Planar& pose, const Eigen::Matrix3d& R);
/// The same of one component.
void update_component(Imm& imm, int index, double value, double variance);

}  // namespace roadfix
