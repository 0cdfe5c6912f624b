/// Alignments of an estimate to a reference. Each hides another kind of error, so a figure is never shown without the
/// name of its alignment.
#pragma once

#include <Eigen/Dense>
#include <optional>
#include <vector>

#include "evaluation/trajectory.h"

namespace roadfix {

enum class Alignment {
  kNone,  ///< as published: absolute error
  kYaw,   ///< yaw and translation: what gravity cannot fix
  kSe3,   ///< rotation and translation
  kSim3,  ///< rotation, translation and scale: monocular vision
  kTied,  ///< yaw and position taken over from the reference once: what an odometry is worth from then on
};

const char* name_of(Alignment alignment);

/// x -> scale * T x.
struct Similarity {
  double scale = 1.0;
  SE3 T;  ///< rotation, then translation in the reference's frame, after scaling
};

/// The similarity of the given kind that brings the estimates' positions closest to the references' in the
/// least-squares sense (Umeyama, PAMI 13, 1991; yaw alone: the same problem restricted to turns about z). Nothing where
/// the positions do not determine it (fewer than three, or all on a line for SE3 and Sim3, all in a point for yaw).
/// kTied is not of that kind: see tie().
std::optional<Similarity> align(const std::vector<PosePair>& pairs, Alignment alignment);

/// The similarity of kTied: the estimate's yaw and position become the reference's at this pair. Needs attitude.
Similarity tie(const PosePair& pair);

/// The same for a reference without attitude: the yaw is that of the displacement from the first pair to the second.
Similarity tie_by_displacement(const PosePair& from, const PosePair& to);

Odometry transformed(const Similarity& S, const Odometry& pose);

}  // namespace roadfix
