// Magnetometer update (MODEL.md, section 9).
#include <cmath>

#include "geometry/so3.h"
#include "wheel/magnetic_heading.h"
#include "wheel/wheel_odometry.h"

namespace roadfix {

using namespace wheel;  // indices of the error state
namespace {

constexpr double kMicrotesla = 1e-6;  ///< T

}  // namespace

WheelInputStatus WheelOdometry::add(const MagSample& mag) {
  const WheelTuning& t = config_.tuning;
  if (!t.use_mag) return WheelInputStatus::kDisabled;
  if (!mag.field.allFinite()) return WheelInputStatus::kBadValue;
  if (!started_) return WheelInputStatus::kAligning;
  if (standstill_.standing && mag_us_) return WheelInputStatus::kNotDue;  // the pose is constant at standstill
  if (mag_us_ && seconds_between(*mag_us_, mag.t_us) < t.mag_interval) return WheelInputStatus::kNotDue;
  const Tilt tilt = state_.tilt();
  const Eigen::Vector3d field = config_.sensors.soft_iron * (mag.field - kMicrotesla * config_.sensors.hard_iron_ut);
  const Eigen::Vector3d level = level_field(field, tilt.roll, tilt.pitch);
  const std::optional<MagneticYaw> measured = magnetic_yaw(field, tilt.roll, tilt.pitch);
  if (!measured) return WheelInputStatus::kBadValue;
  const double strength = level.norm(), dip = std::atan2(-level.z(), level.head<2>().norm());
  if (!mag_us_) {
    mag_strength_ = strength;
    mag_dip_ = dip;
    state_.x(kMagOffset) = wrap_angle(measured->yaw - state_.x(kYaw));
    decouple(state_.P, kMagOffset, kPi);  // the update below reduces it to the noise of the heading and the yaw
  } else if (std::abs(strength / mag_strength_ - 1.0) > t.mag_gate || std::abs(dip - mag_dip_) > t.mag_gate) {
    return WheelInputStatus::kGated;
  }
  WheelVector H = WheelVector::Zero();
  H(kYaw) = 1.0;
  H(kMagOffset) = 1.0;
  H.segment<2>(kRoll) = -measured->by_tilt.transpose();
  const double innovation = wrap_angle(measured->yaw - state_.x(kYaw) - state_.x(kMagOffset));
  const double dt = seconds_between(t_us_, mag.t_us);
  const double turned = standstill_.standing ? 0.0 : (gyro_.z() - state_.x(kGyroBias + 2)) * dt;
  schmidt_update(state_, H, wrap_angle(innovation - turned), t.mag_noise * t.mag_noise,
                 {kPos, kPos + 1, kPos + 2, kYaw, kGyroBias + 2, kMagOffset});
  mag_us_ = mag.t_us;
  return WheelInputStatus::kUsed;
}

}  // namespace roadfix
