/// Start of a map: from one stereo image, or from two monocular images with sufficient parallax.
#include <algorithm>
#include <cmath>

#include "slam/keyframe_tracker.h"
#include "slam/two_view.h"

namespace roadfix {
namespace {

constexpr double kUnmeasuredAcceleration = 1.5;  ///< m/s2, as in distance_history.cpp
constexpr double kMaxReverseSpeed = 5.0;         ///< m/s
constexpr double kBackwardsCosine = 0.5;         ///< with margin for the mounting
constexpr double kNearFlowFactor = 2.0;          ///< times start_flow_px: flow of near tracks, sufficient on their own

}  // namespace

void KeyframeTracker::start(const CameraFrame& frame) {
  if (stereo_ && !frame.right.empty()) {
    relocalise(frame);
    start_stereo(frame);
  } else {
    start_mono(frame);
  }
}

/// The image that loses a map is the first of the next one.
void KeyframeTracker::restart_after_loss(const std::string& loss, const CameraFrame& frame) {
  out_.features.clear();
  out_.num_matches = out_.num_landmarks_seen = out_.num_inliers = 0;
  start(frame);
  if (map_.empty()) out_.reason = loss;
}

void KeyframeTracker::start_stereo(const CameraFrame& frame) {
  std::vector<Feature> features = front_end_->track(frame.left, {});
  cov_own_.setZero();
  cov_window_.setZero();
  make_keyframe(frame, features);
  if (landmarks_at_keyframe_ < config_.start_points) {
    out_.reason = "too few points in both pictures";
    out_.state = state_without_map(frame.t_us, false);
    finish_bundle();
    map_.clear();
    front_end_->reset();
    return;
  }
  constexpr double kGivenSpeedStd = 1.0;  // m/s, of the velocity of a restart
  const bool has_motion = motion_ && !t_good_us_;
  begin_map(frame.t_us, has_motion ? motion_ : std::nullopt, kGivenSpeedStd * kGivenSpeedStd * Matrix6d::Identity());
}

/// Waiting for motion is `initialising`; a blank or dark image is `lost`, also before the first map: another source
/// should provide the pose.
TrackState KeyframeTracker::state_without_map(int64_t t_us, bool usable) {
  if (usable || !t_usable_us_) t_usable_us_ = t_us;
  const bool lost = t_good_us_ || seconds_between(*t_usable_us_, t_us) >= config_.lost_after_s;
  return lost ? TrackState::kLost : TrackState::kInitialising;
}

void KeyframeTracker::begin_map(int64_t t_us, const std::optional<FrameMotion>& motion, const Matrix6d& cov_motion) {
  if (t_good_us_) {  // after a loss: the motion in between is unknown
    continuous_ = relocalised_;
    const double unseen_s = seconds_between(*t_good_us_, t_us);
    constexpr double kAcceleration = 1.0;  // m/s2: the car may have driven on from a traffic light
    const double speed = motion_ && motion_->dt_s > 0.0 ? motion_->T_before_now.p.norm() / motion_->dt_s : 0.0;
    const double unseen = speed * unseen_s + 0.5 * kAcceleration * unseen_s * unseen_s;
    if (!relocalised_) {
      constexpr double kTurnRate = 0.2;  // rad/s, at a street corner, about the vehicle's z, as in apply_restart()
      const Eigen::Vector3d turn =
          kTurnRate * unseen_s * (rig_.T_vehicle_left.q.conjugate() * Eigen::Vector3d::UnitZ());
      cov_keyframe_.bottomRightCorner<3, 3>() += turn * turn.transpose();
      cov_closed_.bottomRightCorner<3, 3>() += turn * turn.transpose();
      cov_keyframe_.topLeftCorner<3, 3>().diagonal().array() += unseen * unseen;
      cov_closed_.topLeftCorner<3, 3>().diagonal().array() += unseen * unseen;
      out_.reset_delta = SE3{};
    }
    ++out_.reset_counter;
    ++out_.closed_reset_counter;
    out_.closed_reset_delta = out_.reset_delta;
  }
  motion_ = motion;
  t_begun_us_ = t_us;
  first_place_ = loops_.next_place();
  t_usable_us_.reset();
  out_.map_started = true;
  out_.state = relocalised_ ? TrackState::kRelocalised : TrackState::kGood;
  out_.reason = relocalised_ ? "found back at a place seen before" : "";
  relocalised_ = false;
  set_pose(t_us, map_.last().T_map_camera, Matrix6d::Zero(), cov_motion);
}

int KeyframeTracker::count_landmarks(const std::vector<KeyframeFeature>& features) const {
  int count = 0;
  for (const KeyframeFeature& f : features) {
    const Landmark* landmark = map_.find(f.track);
    count += landmark != nullptr && landmark->p_map ? 1 : 0;
  }
  return count;
}

void KeyframeTracker::begin_initialisation(const CameraFrame& frame, const std::vector<Feature>& features) {
  relocalise(frame);
  start_ = MonoStart{};
  start_->t_us = frame.t_us;
  record_attitude(frame.t_us);
  std::vector<Feature> all = features;
  for (const Feature& f : front_end_->replenish()) {
    all.push_back(f);
    out_.features.push_back({f, FeatureStatus::kNew});
  }
  for (const Feature& f : all) {
    if (const auto normalised = left_.unproject(f.pixel.cast<double>())) start_->seen[f.track] = *normalised;
  }
}

void KeyframeTracker::wait_for_parallax(int64_t t_us, size_t points) {
  const bool usable = static_cast<int>(points) >= config_.start_points;
  out_.state = state_without_map(t_us, usable);
  out_.reason = usable ? "waiting for parallax" : "too few points in the picture";
}

void KeyframeTracker::start_mono(const CameraFrame& frame) {
  const std::vector<Feature> features = front_end_->track(frame.left, {});
  out_.num_expected = front_end_->num_expected();
  out_.num_matches = static_cast<int>(features.size());
  Pairs pairs;
  std::vector<double> flow;
  for (const Feature& f : features) {
    out_.features.push_back({f, FeatureStatus::kMatched});
    const auto normalised = left_.unproject(f.pixel.cast<double>());
    if (!start_ || !start_->seen.contains(f.track) || !normalised) continue;
    pairs.tracks.push_back(f.track);
    pairs.first.push_back(start_->seen.at(f.track));
    pairs.second.push_back(*normalised);
    flow.push_back(left_.focal() * (pairs.second.back() - pairs.first.back()).norm());
  }
  if (!start_) {
    begin_initialisation(frame, features);
    wait_for_parallax(frame.t_us, start_->seen.size());
    return;
  }
  wait_for_parallax(frame.t_us, pairs.tracks.size());
  if (flow.empty()) flow.push_back(0.0);
  std::nth_element(flow.begin(), flow.begin() + static_cast<std::ptrdiff_t>(flow.size() / 2), flow.end());
  if (flow.size() > 1 && flow[flow.size() / 2] < config_.standing_flow_px) record_attitude(frame.t_us);
  // Near tracks leave the image first and the remaining ones move little: try a short baseline rather than none. The
  // parallax check decides.
  const bool last_chance = 2 * pairs.tracks.size() < start_->seen.size();
  // On a highway most tracks are too far away to move: count the near ones.
  const double near_px = kNearFlowFactor * config_.start_flow_px;
  const auto near = std::count_if(flow.begin(), flow.end(), [near_px](double px) { return px >= near_px; });
  const bool enough = flow[flow.size() / 2] >= config_.start_flow_px || near >= config_.start_points;
  if (last_chance || enough) finish_initialisation(frame, pairs);
  if (last_chance && map_.empty()) {
    begin_initialisation(frame, features);
    wait_for_parallax(frame.t_us, start_->seen.size());
  }
}

void KeyframeTracker::finish_initialisation(const CameraFrame& frame, const Pairs& pairs) {
  TwoViewConfig config;
  config.focal_px = left_.focal();
  config.gate_px = config_.gate_px;
  config.min_angle_deg = config_.min_parallax_deg;
  config.min_points = config_.start_points;
  const auto motion = two_view_motion(pairs.first, pairs.second, config);
  if (!motion) return;
  double baseline = 1.0;  // arbitrary unit
  const double dt_s = seconds_between(start_->t_us, frame.t_us);
  const auto known = camera_distance(start_->t_us, SE3{}, frame.t_us, motion->T_first_second);
  // Mismatched posts and lane markings appear as backward motion; a car at this speed does not reverse.
  const Eigen::Vector3d ahead = rig_.T_vehicle_left.q.conjugate() * Eigen::Vector3d::UnitX();
  const bool forwards = known && !known->travelled.backwards && known->travelled.distance > kMaxReverseSpeed * dt_s;
  if (forwards && motion->T_first_second.p.dot(ahead) < -kBackwardsCosine) return;
  if (known) {
    baseline = std::max(0.01, known->travelled.distance);
    set_scale_source(*known);
  } else if (motion_ && motion_->dt_s > 0.0) {  // speed before the loss, or of a pull-away
    baseline = std::max(
        {0.01, motion_->T_before_now.p.norm() / motion_->dt_s * dt_s, 0.5 * kUnmeasuredAcceleration * dt_s * dt_s});
  }
  std::vector<KeyframeFeature> first, second;
  pixels_.clear();
  std::vector<int64_t> wrong;
  auto used = out_.features.begin();  // in the order of the pairs
  for (size_t i = 0; i < pairs.tracks.size(); ++i) {
    while (used->feature.track != pairs.tracks[i]) ++used;
    used->status = motion->inlier[i] ? FeatureStatus::kInlier : FeatureStatus::kOutlier;
    if (motion->inlier[i]) {
      pixels_[pairs.tracks[i]] = used->feature.pixel;
      first.push_back({pairs.tracks[i], pairs.first[i], {}});
      second.push_back({pairs.tracks[i], pairs.second[i], {}});
    } else {
      wrong.push_back(pairs.tracks[i]);
    }
  }
  map_.add_keyframe({0, start_->t_us, T_map_camera_, {}, LensSensitivity::Zero(), {}}, first);
  const SE3 T_map_second = T_map_camera_ * SE3{motion->T_first_second.q, baseline * motion->T_first_second.p};
  front_end_->drop(wrong);
  out_.num_landmarks_seen = static_cast<int>(pairs.tracks.size());
  out_.num_inliers = static_cast<int>(first.size());
  for (const Feature& f : front_end_->replenish()) {  // new tracks, needed when the first ones leave the image
    out_.features.push_back({f, FeatureStatus::kNew});
    const auto normalised = left_.unproject(f.pixel.cast<double>());
    if (!normalised) continue;
    second.push_back({f.track, *normalised, {}});
    pixels_[f.track] = f.pixel;
  }
  map_.add_keyframe({0, frame.t_us, T_map_second, baseline, LensSensitivity::Zero(), {}}, second);
  landmarks_at_keyframe_ = count_landmarks(second);
  cov_own_.setZero();
  cov_window_.setZero();
  begin_bundle();
  finish_bundle();
  const FrameMotion initial_motion{map_.keyframes().front().T_map_camera.inverse() * T_map_camera_, dt_s};
  start_.reset();
  // A mean over up to seconds: an accelerating car is faster at the end.
  Matrix6d cov_motion = cov_own_;
  const double slip = 0.5 * kUnmeasuredAcceleration * initial_motion.dt_s * initial_motion.dt_s;
  cov_motion.topLeftCorner<3, 3>().diagonal().array() += slip * slip;
  begin_map(frame.t_us, initial_motion, cov_motion);
}

}  // namespace roadfix
