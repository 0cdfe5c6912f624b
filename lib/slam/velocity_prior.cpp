#include "slam/velocity_prior.h"

#include "geometry/so3.h"

namespace roadfix {
namespace {

constexpr double kMaxRotationJump = 0.2;     ///< rad, instantaneous deviation from the predicted motion
constexpr double kMaxRotationRate = 3.0;     ///< rad/s, limit of the change of rotation
constexpr double kVisualSpeedStd = 0.2;      ///< m/s, of a speed from two images
constexpr double kUnknownSpeedStd = 30.0;    ///< m/s, with a pose but no motion yet
constexpr double kBraking = 4.0;             ///< m/s2, firm braking
constexpr double kTurnRate = 0.2;            ///< rad/s, at a street corner or on its ramp
constexpr double kUnseenAcceleration = 1.0;  ///< m/s2: the car may have driven on from a traffic light

}  // namespace

void VelocityPrior::set_velocity(const Eigen::Vector3d& velocity) {
  motion_ = FrameMotion{{Eigen::Quaterniond::Identity(), velocity}, 1.0};
}

void VelocityPrior::rescale(double factor) {
  if (motion_) motion_->T_before_now.p *= factor;
}

SE3 VelocityPrior::predict(const SE3& T_map_camera, double dt_s) const {
  if (!known()) return T_map_camera;
  const SE3& T = motion_->T_before_now;
  const double factor = dt_s / motion_->dt_s;
  return T_map_camera * SE3{exp_q(factor * log_q(T.q)), factor * T.p};
}

double VelocityPrior::max_turn_error(double unseen_s) { return kMaxRotationJump + kMaxRotationRate * unseen_s; }

double VelocityPrior::velocity_sigma(double unseen_s) const {
  return known() ? kVisualSpeedStd + kBraking * unseen_s : kUnknownSpeedStd;
}

UnseenMotion VelocityPrior::since_loss(double unseen_s) const {
  return {speed() * unseen_s + 0.5 * kUnseenAcceleration * unseen_s * unseen_s, kTurnRate * unseen_s};
}

UnseenMotion VelocityPrior::since_pose(double speed, double dt_s) {
  return {0.5 * dt_s * dt_s * (kUnseenAcceleration + kTurnRate * speed), kTurnRate * dt_s};
}

}  // namespace roadfix
