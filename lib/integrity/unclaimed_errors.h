/// Errors of a pose that its covariance does not have: the lever arm's, as the last positions saw it, and a heading that
/// follows late in turns. lib/integrity/MODEL.md, (P.3.1) and (P.3.3).
#pragma once

#include <Eigen/Dense>

#include "integrity/integrity_config.h"
#include "samples/samples.h"

namespace roadfix {

class UnclaimedErrors {
 public:
  /// The estimate's next pose, dt seconds later.
  void see_turn(const Odometry& estimate, double dt);
  /// `coasting`: there are no positions that see the arm as it lies now.
  void turn_lever_arm(const Eigen::Matrix3d& R_frame_vehicle, const Eigen::Vector3d& arm_std, bool coasting);

  /// m2, along, across, up of the newest pose.
  [[nodiscard]] const Eigen::Vector3d& lever_variance() const { return lever_variance_; }
  /// m2, likewise, with clocks that are off by `timing_std` s.
  [[nodiscard]] Eigen::Vector3d timing_variance(double timing_std) const;

  template <class Self, class Archive>
  static void archive(Self& self, Archive& a) {
    a(self.lever_enu_, self.lever_variance_, self.turning_);
  }

 private:
  Eigen::Matrix3d lever_enu_ = Eigen::Matrix3d::Zero();  ///< m2
  Eigen::Vector3d lever_variance_ = Eigen::Vector3d::Zero();
  double turning_ = 0.0;  ///< m/s2, the last seconds' largest lateral acceleration, decaying
};

}  // namespace roadfix
