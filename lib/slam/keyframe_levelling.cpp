/// Levelling of the tracker's map by an INS attitude, once.
#include <cmath>

#include "slam/keyframe_tracker.h"
#include "slam/pose_covariance.h"

namespace roadfix {
namespace {

constexpr int64_t kAttitudeHistory_us = 1'500'000;  ///< INS attitudes are 0.5 s late
constexpr int64_t kMaxAttitudeGap_us = 25'000;      ///< a car's body rotates by less than 0.1 deg in this time

}  // namespace

void KeyframeTracker::record_attitude(int64_t t_us) {
  if (levelled_ || config_.level_std_deg <= 0.0) return;
  attitudes_.push_back({t_us, (T_map_camera_ * rig_.T_vehicle_left.inverse()).q});
  while (attitudes_.front().t_us < t_us - kAttitudeHistory_us) attitudes_.pop_front();
}

void KeyframeTracker::apply_levelling() {
  const double worst = config_.level_std_deg * M_PI / 180.0;
  for (const AttitudeSample& sample : new_attitudes_) {
    if (levelled_ || !(sample.sigma <= worst)) continue;
    for (const Attitude& seen : attitudes_) {
      if (std::abs(seen.t_us - sample.t_us) > kMaxAttitudeGap_us) continue;
      rotate_map(levelling_rotation(seen.q_map_vehicle, sample.q_level_vehicle), sample.sigma);
      break;
    }
  }
  new_attitudes_.clear();
}

/// About the vehicle: its position is unchanged, its past trajectory rotates.
void KeyframeTracker::rotate_map(const Eigen::Quaterniond& q, double sigma) {
  const SE3 T_vehicle_left = rig_.T_vehicle_left, T_map_vehicle = T_map_camera_ * T_vehicle_left.inverse();
  const LevellingRotation turn{q, T_map_vehicle.p, sigma};
  map_.move(turn.transform());
  loops_.rotate(turn);
  T_map_camera_ = turn.transform() * T_map_camera_;
  const SE3& T_known = map_.empty() ? T_map_camera_ : map_.last().T_map_camera;
  cov_keyframe_ = turn.covariance(cov_keyframe_, T_known);
  cov_own_ = rotated(cov_own_, {q, {}, 1.0});
  cov_window_ = rotated(cov_window_, {q, {}, 1.0});
  cov_closed_ = turn.covariance(cov_closed_, loops_.S_map_odom().rigid() * T_known);
  considered_.move(turn.transform());
  considered_closed_.move(turn.transform());
  levelled_ = true;
  attitudes_.clear();
  if (!t_good_us_) return;  // no pose has been published yet
  const SE3 T_turned = T_map_camera_ * T_vehicle_left.inverse();
  ++out_.reset_counter;
  ++out_.closed_reset_counter;
  out_.reset_delta = out_.closed_reset_delta = {T_map_vehicle.q.conjugate() * T_turned.q, Eigen::Vector3d::Zero()};
}

}  // namespace roadfix
