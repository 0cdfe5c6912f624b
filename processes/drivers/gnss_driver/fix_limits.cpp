#include "drivers/gnss_driver/fix_limits.h"

#include <algorithm>
#include <cmath>

#include "geometry/frames.h"

namespace roadfix {

namespace {

// Wide: what is improbable is left to the estimators. Here goes only what no road and no receiver has.
constexpr double kLowest_m = -1000.0, kHighest_m = 20'000.0;
constexpr double kMaxStd_m = 1e7;  // u-blox says 4.3e6 where it knows nothing
constexpr double kMaxSpeed_mps = 1000.0, kMaxSpeedStd_mps = 1e7;
constexpr double kMaxDop = 1e4;
constexpr double kOldest_s = 1e6;

/// A fix that claims to have no error says nothing of its error.
bool are_variances(const Eigen::Matrix3d& cov, double max_std) {
  return cov.allFinite() && cov.diagonal().minCoeff() > 0.0 && cov.diagonal().maxCoeff() <= max_std * max_std;
}

bool is_position(const GnssFix& fix) {
  const Geodetic& p = fix.antenna;
  return std::abs(p.latitude) <= 0.5 * kPi && std::abs(p.longitude) <= kPi && p.height >= kLowest_m &&
         p.height <= kHighest_m && are_variances(fix.cov_enu, kMaxStd_m);
}

bool is_velocity(const GnssVelocity& v) {
  return v.enu.cwiseAbs().maxCoeff() <= kMaxSpeed_mps && are_variances(v.cov_enu, kMaxSpeedStd_mps);
}

bool is_heading(const GnssHeading& h) {
  return h.heading >= 0.0 && h.heading <= 2.0 * kPi && h.sigma > 0.0 && h.sigma <= kPi;
}

}  // namespace

FixLimits limit_fix(GnssFix& fix) {
  FixLimits result;
  if (fix.fix_type == FixType::kNone) {
    fix.velocity.reset();
    fix.heading.reset();
    if (!is_position(fix)) {
      GnssFix blank;
      blank.t_us = fix.t_us;
      blank.height_kind = HeightKind::kUnknown;
      fix = blank;
    }
  } else if (!is_position(fix)) {
    ++result.refused;
    return result;
  }
  result.publish = true;
  if (fix.velocity && !(fix.velocity->enu.allFinite() && is_velocity(*fix.velocity))) {
    fix.velocity.reset();
    ++result.refused;
  }
  if (fix.heading && !is_heading(*fix.heading)) {
    fix.heading.reset();
    ++result.refused;
  }
  if (fix.pdop && !(*fix.pdop >= 0.0 && *fix.pdop <= kMaxDop)) fix.pdop.reset();
  if (fix.correction_age) *fix.correction_age = std::min(*fix.correction_age, kOldest_s);
  return result;
}

}  // namespace roadfix
