#include "integrity/unclaimed_errors.h"

#include <algorithm>
#include <cmath>

namespace roadfix {
namespace {

constexpr double kCorrectionTime = 2.0;  // s, within which positions correct a heading

}  // namespace

void UnclaimedErrors::see_turn(const Odometry& estimate, double dt) {
  const double lateral = std::abs(estimate.velocity.x() * estimate.angular_rate.z());
  turning_ = std::max(lateral, turning_ * std::exp(-std::max(0.0, dt) / kCorrectionTime));
}

void UnclaimedErrors::turn_lever_arm(const Eigen::Matrix3d& R_frame_vehicle, const Eigen::Vector3d& arm_std,
                                     bool coasting) {
  const Eigen::Vector3d variance = arm_std.cwiseAbs2();
  if (!coasting) lever_enu_ = R_frame_vehicle * variance.asDiagonal() * R_frame_vehicle.transpose();
  const Eigen::Matrix3d turned = R_frame_vehicle.transpose() * lever_enu_ * R_frame_vehicle;
  lever_variance_ = variance.cwiseMax(turned.diagonal());
}

/// A heading late by that, followed so long.
Eigen::Vector3d UnclaimedErrors::timing_variance(double timing_std) const {
  const double late = timing_std * turning_ * kCorrectionTime;
  return {0.0, late * late, 0.0};
}

}  // namespace roadfix
