/// What is known of the vehicle's motion beside its images, each part with its sigma. Poses are estimated from images;
/// these give the monocular scale, the place where tracks are searched, and the axes of the map.
#pragma once

#include "slam/distance_prior.h"
#include "slam/gravity_prior.h"
#include "slam/velocity_prior.h"

namespace roadfix {

struct MotionPrior {
  DistancePrior distance;  ///< from speeds
  VelocityPrior velocity;  ///< turn and displacement, from the last motion
  GravityPrior gravity;    ///< from an INS's attitude

  template <class Self, class Archive>
  static void members(Self& self, Archive& archive) {
    archive(self.distance, self.velocity, self.gravity);
  }
};

}  // namespace roadfix
