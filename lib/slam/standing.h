/// What ties two keyframes of a car that stands, (M.8d): pictures that do not move tell no depth, but where the car is.
#pragma once

#include "geometry/se3.h"

namespace roadfix {

/// By how much a car that stands may have moved all the same, standard deviations along and about each axis.
struct StandingDoubt {
  double way = 0.0;   ///< m
  double turn = 0.0;  ///< rad

  template <class Self, class Archive>
  static void members(Self& self, Archive& archive) {
    archive(self.way, self.turn);
  }
};

/// What is missing to standing, in sigmas, and its derivatives by both poses, of what is told, not of what is missing.
struct StandingTie {
  Vector6d missing;
  Matrix6d J_earlier = Matrix6d::Zero(), J_later = Matrix6d::Zero();
};

StandingTie standing_tie(const SE3& T_map_earlier, const SE3& T_map_later, const StandingDoubt& doubt);

}  // namespace roadfix
