#include "wheel/heading_update.h"

#include <algorithm>
#include <cmath>

#include "geometry/frames.h"
#include "geometry/so3.h"
#include "wheel/magnetic_heading.h"

namespace roadfix {

using namespace wheel;  // indices of the error state

bool HeadingUpdate::due(int64_t t_us, bool standing) const {
  if (!last_us_) return true;
  return !standing && seconds_between(*last_us_, t_us) >= config_.tuning.mag_interval;
}

WheelInputStatus HeadingUpdate::update(WheelState& state, const MagSample& mag, double yaw_rate, bool standing) {
  const WheelTuning& t = config_.tuning;
  if (!due(mag.t_us, standing)) return WheelInputStatus::kNotDue;
  const Tilt tilt = state.tilt();
  const Eigen::Vector3d field = config_.sensors.soft_iron * (mag.field - config_.sensors.hard_iron);
  const Eigen::Vector3d level = level_field(field, tilt.roll, tilt.pitch);
  const std::optional<MagneticYaw> measured = magnetic_yaw(field, tilt.roll, tilt.pitch);
  if (!measured) return WheelInputStatus::kBadValue;
  const double strength = level.norm(), dip = std::atan2(-level.z(), level.head<2>().norm());
  if (!last_us_) {
    strength_ = strength;
    dip_ = dip;
    state.x(kMagOffset) = wrap_angle(measured->yaw - state.x(kYaw));
    decouple(state.P, kMagOffset, kPi);  // the update below reduces it to the noise of the heading and the yaw
  } else if (std::max(std::abs(strength / strength_ - 1.0), std::abs(dip - dip_)) > 2.0 * t.mag_noise) {
    // Two sigma: a disturbance changes strength (relative) and dip (rad) by about as much as the heading.
    return WheelInputStatus::kGated;
  }
  WheelVector H = WheelVector::Zero();
  H(kYaw) = 1.0;
  H(kMagOffset) = 1.0;
  H.segment<2>(kRoll) = -measured->by_tilt.transpose();
  const double innovation = wrap_angle(measured->yaw - state.x(kYaw) - state.x(kMagOffset));
  const double turned = standing ? 0.0 : yaw_rate * seconds_between(state.t_us, mag.t_us);
  schmidt_update(state, H, wrap_angle(innovation - turned), t.mag_noise * t.mag_noise,
                 {kPos, kPos + 1, kPos + 2, kYaw, kGyroBias + 2, kMagOffset});
  last_us_ = mag.t_us;
  return WheelInputStatus::kUsed;
}

}  // namespace roadfix
