// What is published: the predicted pose with its validity, and the status in words.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "navigation/navigation.h"

namespace roadfix::navigation {

namespace {

constexpr char kHeadingRoughly[] = "the heading is known roughly";
constexpr char kNotTied[] = "a local frame, until fixes tie it";
constexpr char kDisplaced[] = "GNSS positions contradict all else and are taken for displaced";
constexpr char kHeightContradicts[] = "the height of GNSS contradicts and is taken for an error of the receiver";

constexpr char kWaitsForRest[] =
    "rest, a speed from the wheels, or pictures of a drive that speeds up, brakes or turns";
constexpr double kInvalidVelocity = 2.0;  // m/s, sigma: without GNSS, more is no motion estimate

const char* waiting_for(Phase phase, bool has_imu, bool has_fix) {
  switch (phase) {
    case Phase::kDone:
      return "";
    case Phase::kHeading:
      return "heading: drive, with turns or changes of speed";
    case Phase::kLevelling:
      return "levelling: a second fix and calm samples";
    case Phase::kWaiting:
      break;
  }
  if (!has_imu) return "IMU samples";
  return has_fix ? "levelling" : "a GNSS fix";
}

}  // namespace

NavigationOutput Navigation::output() {
  NavigationOutput out;
  out.phase = phase_;
  out.local = local_;
  out.reset_counter = reset_counter_;
  out.reset_delta = reset_delta_;
  out.odometry.t_us = ring_.empty() ? last_step_us_ : ring_.back().t_us;
  const char* waits = without_gnss() ? kWaitsForRest : waiting_for(phase_, last_step_us_ != 0, alignment_.has_fix());
  if (filter() == nullptr) {
    out.reason = std::string("waits for ") + waits;
    return out;
  }
  rebase_predictor();
  out.odometry = predictor_->output();
  const double horizontal = std::sqrt(out.odometry.cov_pose(0, 0) + out.odometry.cov_pose(1, 1));
  if (!usable()) {
    out.reason = std::string("waits for ") + waits;
  } else if (local_ && out.odometry.cov_velocity.diagonal().maxCoeff() > kInvalidVelocity * kInvalidVelocity) {
    out.reason = "velocity not known well enough";
  } else if (!(horizontal < config_.start.invalid_sigma_m) && !local_) {
    out.reason = "position too uncertain";
  } else {
    const bool coasting = coasting_since().has_value();
    if (phase_ == Phase::kHeading) out.reason = kHeadingRoughly;
    out.odometry.validity = coasting || alignment_.parked() ? Validity::kCoasting : Validity::kValid;
    if (local_ && !without_gnss()) out.reason = kNotTied;
    if (coasting) out.reason = local_ ? "coasting without wheels and tracks" : "coasting without GNSS";
    if (alignment_.parked()) out.reason = "from the place where it was parked, without GNSS yet";
    if (aiding_.gnss_position().height_displaced()) out.reason = kHeightContradicts;
    if (aiding_.gnss_position().displaced()) out.reason = kDisplaced;
    if (imu_noise_.frozen()) out.reason = "IMU readings do not change";
  }
  return out;
}

double Navigation::coasting_time() const {
  constexpr double kMissed = 2.0;  // intervals, after which a fix has been missed
  return std::max(config_.start.coasting_s, kMissed * screen_.interval());
}

std::optional<int64_t> Navigation::coasting_since() const {
  const auto used_at = [&](AidingSource source) { return used_at_us_[static_cast<size_t>(source)]; };
  int64_t anchored = std::max(used_at(AidingSource::kGnssPosition), used_at(AidingSource::kZeroVelocity));
  if (local_) anchored = std::max({anchored, used_at(AidingSource::kWheelSpeed), used_at(AidingSource::kCameraTracks)});
  const bool coasting = usable() && seconds_between(anchored, last_step_us_) > coasting_time();
  return coasting ? std::optional(anchored) : std::nullopt;
}

NavigationStatus Navigation::status() const {
  NavigationStatus s;
  s.phase = phase_;
  s.waits_for = waiting_for(phase_, last_step_us_ != 0, alignment_.has_fix());
  if (without_gnss() && phase_ != Phase::kDone) s.waits_for = kWaitsForRest;
  s.gnss_quality = screen_.quality();
  s.gnss_reason = screen_.reason();
  if (s.gnss_reason.empty() && aiding_.gnss_position().height_displaced()) s.gnss_reason = kHeightContradicts;
  if (s.gnss_reason.empty() && aiding_.gnss_position().displaced()) s.gnss_reason = kDisplaced;
  if (s.gnss_reason.empty() && arm_contradicted_ && filter() != nullptr) {
    const Eigen::Vector3d off = filter()->state().x.p_imu_antenna - config_.facts.p_imu_antenna;
    s.gnss_reason = fmt::format("the antenna is {:.1f} m from where the calibration has it", off.norm());
  }
  s.bad_imu_samples = bad_imu_;
  s.imu_gaps = gaps_;
  s.wheel_scale_steps = steps_ + aiding_.wheel_speed().scale_steps();
  s.imu_frozen = imu_noise_.frozen();
  for (size_t i = 0; i < kAidingSources; ++i)
    if (used_at_us_[i] != 0 && seconds_between(used_at_us_[i], last_step_us_) <= coasting_time()) s.aided_by |= 1 << i;
  s.coasting = coasting_since().has_value();
  s.coasting_since_us = coasting_since().value_or(0);
  return s;
}

}  // namespace roadfix::navigation
