#include "navigation/status.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace roadfix::navigation {

namespace {

constexpr char kHeadingRoughly[] = "the heading is known roughly";
constexpr char kNotTied[] = "a local frame, until fixes tie it";
constexpr char kDisplaced[] = "GNSS positions contradict all else and are taken for displaced";
constexpr char kHeightContradicts[] = "the height of GNSS contradicts and is taken for an error of the receiver";

constexpr double kInvalidVelocity = 2.0;  // m/s, sigma: without GNSS, more is no motion estimate

}  // namespace

const char* StatusReport::waits_for() const {
  if (!config_.sources.any_gnss() && start_.phase() != Phase::kDone)
    return "rest, a speed from the wheels, or pictures of a drive that speeds up, brakes or turns";
  switch (start_.phase()) {
    case Phase::kDone:
      return "";
    case Phase::kHeading:
      return "heading: drive, with turns or changes of speed";
    case Phase::kLevelling:
      return "levelling: a second fix and calm samples";
    case Phase::kWaiting:
      break;
  }
  if (motion_.last_us() == 0) return "IMU samples";
  return start_.fix() ? "levelling" : "a GNSS fix";
}

void StatusReport::judge(NavigationOutput& out) const {
  Odometry& odometry = out.odometry;
  const bool local = frame_.local();
  const double horizontal = std::sqrt(odometry.cov_pose(0, 0) + odometry.cov_pose(1, 1));
  if (!start_.usable()) {
    out.reason = std::string("waits for ") + waits_for();
  } else if (local && out.imu.cov_velocity.diagonal().maxCoeff() > kInvalidVelocity * kInvalidVelocity) {
    out.reason = "velocity not known well enough";
  } else if (!(horizontal < config_.start.invalid_sigma_m) && !local) {
    out.reason = "position too uncertain";
  } else {
    const bool coasting = coasting_since().has_value();
    if (start_.phase() == Phase::kHeading) out.reason = kHeadingRoughly;
    odometry.validity = coasting || start_.parked() ? Validity::kCoasting : Validity::kValid;
    if (local && config_.sources.any_gnss()) out.reason = kNotTied;
    if (coasting) out.reason = local ? "coasting without wheels and tracks" : "coasting without GNSS";
    if (start_.parked()) out.reason = "from the place where it was parked, without GNSS yet";
    if (aiding_.gnss_position().height_displaced()) out.reason = kHeightContradicts;
    if (aiding_.gnss_position().displaced()) out.reason = kDisplaced;
    if (motion_.frozen()) out.reason = "IMU readings do not change";
  }
}

double StatusReport::coasting_time() const {
  constexpr double kMissed = 2.0;  // intervals, after which a fix has been missed
  return std::max(config_.start.coasting_s, kMissed * measurements_.gnss().interval());
}

std::optional<int64_t> StatusReport::coasting_since() const {
  int64_t anchored = log_.last_use_us({AidingSource::kGnssPosition, AidingSource::kZeroVelocity});
  if (frame_.local())
    anchored = std::max(anchored, log_.last_use_us({AidingSource::kWheelSpeed, AidingSource::kCameraTracks}));
  const bool coasting = start_.usable() && seconds_between(anchored, motion_.last_us()) > coasting_time();
  return coasting ? std::optional(anchored) : std::nullopt;
}

NavigationStatus StatusReport::status(const Filter* filter) const {
  NavigationStatus s;
  s.phase = start_.phase();
  s.waits_for = waits_for();
  s.gnss_quality = measurements_.gnss().quality();
  s.gnss_reason = measurements_.gnss().reason();
  if (s.gnss_reason.empty() && aiding_.gnss_position().height_displaced()) s.gnss_reason = kHeightContradicts;
  if (s.gnss_reason.empty() && aiding_.gnss_position().displaced()) s.gnss_reason = kDisplaced;
  if (s.gnss_reason.empty() && aiding_.arm_contradicted() && filter != nullptr) {
    const Eigen::Vector3d off = filter->state().x.p_imu_antenna - config_.facts.p_imu_antenna;
    s.gnss_reason = fmt::format("the antenna is {:.1f} m from where the calibration has it", off.norm());
  }
  s.bad_imu_samples = motion_.bad_samples();
  s.imu_gaps = motion_.gaps();
  s.wheel_scale_steps = aiding_.wheel_scale_steps();
  s.imu_frozen = motion_.frozen();
  s.aided_by = log_.aided_by(motion_.last_us(), coasting_time());
  s.coasting = coasting_since().has_value();
  s.coasting_since_us = coasting_since().value_or(0);
  return s;
}

}  // namespace roadfix::navigation
