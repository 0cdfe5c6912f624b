/// Gravity and Earth rotation in the anchor's frame. Gravity is evaluated again only after a move of kGravityStep (its
/// gradient is 3e-6 1/s2 along the vertical, 1.6e-6 across: 5e-5 m/s2 at most), at points fixed by the path alone.
#pragma once

#include "geodesy/enu_anchor.h"

namespace roadfix {

class EarthModel {
 public:
  explicit EarthModel(const Geodetic& anchor);

  [[nodiscard]] const EnuAnchor& anchor() const { return anchor_; }
  [[nodiscard]] const Eigen::Vector3d& rate() const { return rate_; }  ///< rad/s, enu axes
  /// m/s2 at p_enu, enu axes.
  [[nodiscard]] const Eigen::Vector3d& gravity(const Eigen::Vector3d& p_enu);

  template <class Archive>
  void serialise(Archive& a) {
    a(evaluated_at_, gravity_);
  }

 private:
  static constexpr double kGravityStep = 10.0;  // m
  EnuAnchor anchor_;
  Eigen::Vector3d rate_;
  Eigen::Vector3d evaluated_at_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d gravity_;
};

}  // namespace roadfix
