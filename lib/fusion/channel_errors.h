/// How large a channel's errors are that are new from step to step: as configured, as windows show them, and as a filter
/// claims (MODEL.md, section 4).
#pragma once

#include "fusion/fusion_config.h"
#include "fusion/planar.h"

namespace roadfix {

class ChannelErrors {
 public:
  explicit ChannelErrors(const ChannelNoise& noise) : noise_(noise) {}

  /// The variance of its yaw as it claims it, before and now, dt seconds later.
  void see_yaw(double before, double now, double dt);
  /// Covariance of a motion of dt seconds. `claims`: its velocity's covariance counts, and the growth of its yaw's; or
  /// null.
  [[nodiscard]] Eigen::Matrix3d of_step(double dt, const Odometry* claims) const;
  /// Covariance of a window's motion, start and end jitter included (F.5.2).
  [[nodiscard]] Eigen::Matrix3d of_window(const Planar& motion, double dt) const;
  /// What a motion by one velocity adds to of_step().
  [[nodiscard]] Eigen::Vector3d of_velocity(double dt) const;
  /// Compares its squared residual of a window with what is expected: sets the factors (F.4.4).
  void adapt(const Planar& residual, const Planar& motion, double dt, const Eigen::Matrix3d& reference);
  [[nodiscard]] const Eigen::Vector2d& factors() const { return factors_; }

  template <class Self, class Visitor>
  static void visit_members(Self& self, const Visitor& visit) {
    visit(self.factors_, self.yaw_growth_);
  }

 private:
  ChannelNoise noise_;
  Eigen::Vector2d factors_ = Eigen::Vector2d::Ones();  ///< on the variances of place and yaw
  double yaw_growth_ = 0.0;                            ///< rad2/s, of the variance that it claims
};

}  // namespace roadfix
