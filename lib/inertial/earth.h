/// Gravity and Earth rotation in a level frame. At a WGS84 anchor (enu): normal gravity and the Earth's rate. Without
/// an anchor (a local frame, z up): standard gravity and no rotation, because latitude and heading are unknown.
/// Kinematic: neither, for motion that is given against the ground.
///
/// Gravity is evaluated again only after a move of kGravityStep (its gradient is 3e-6 1/s2 along the vertical: 5e-5
/// m/s2 at most), at points fixed by the path alone.
#pragma once

#include "geodesy/enu_anchor.h"

namespace roadfix::inertial {

inline constexpr double kStandardGravity = 9.80665;  ///< m/s2 (CGPM 1901)

class Earth {
 public:
  Earth() = default;
  explicit Earth(const Geodetic& anchor);
  [[nodiscard]] static Earth kinematic() {
    Earth earth;
    earth.gravity_.setZero();
    return earth;
  }

  [[nodiscard]] bool anchored() const { return anchored_; }
  [[nodiscard]] const Eigen::Vector3d& rate() const { return rate_; }  ///< rad/s, level frame
  /// m/s2 at p (m, level frame).
  [[nodiscard]] const Eigen::Vector3d& gravity(const Eigen::Vector3d& p);

  template <class Archive>
  void serialise(Archive& a) {
    a(evaluated_at_, gravity_);
  }

 private:
  static constexpr double kGravityStep = 10.0;  // m

  bool anchored_ = false;
  EnuAnchor anchor_{Geodetic()};
  Eigen::Vector3d rate_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d evaluated_at_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d gravity_ = {0.0, 0.0, -kStandardGravity};
};

}  // namespace roadfix::inertial
