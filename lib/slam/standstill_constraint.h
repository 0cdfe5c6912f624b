/// Zero-motion constraint between two keyframes at a standstill, (S.7.6): static images carry no depth information.
#pragma once

#include "geometry/se3.h"

namespace roadfix {

/// Standard deviations of the residual motion at a standstill, per axis.
struct StandstillSigma {
  double position = 0.0;  ///< m
  double rotation = 0.0;  ///< rad

  template <class Self, class Archive>
  static void members(Self& self, Archive& archive) {
    archive(self.position, self.rotation);
  }
};

/// Residual of zero motion, normalised by sigma, and the Jacobians of the motion by both poses.
struct StandstillConstraint {
  Vector6d residual;
  Matrix6d J_earlier = Matrix6d::Zero(), J_later = Matrix6d::Zero();
};

StandstillConstraint standstill_constraint(const SE3& T_map_earlier, const SE3& T_map_later,
                                           const StandstillSigma& sigma);

}  // namespace roadfix
