/// How a map begins: at once with stereo, from two pictures that are far enough apart without.
#include <algorithm>
#include <cmath>

#include "slam/keyframe_tracker.h"
#include "slam/two_view.h"

namespace roadfix {
namespace {

constexpr double kUnseen = 1.5;       ///< m/s2, as in travel.cpp: what a car's speed changes by unseen
constexpr double kFastestBack = 5.0;  ///< m/s: nobody reverses faster
constexpr double kClearly = 0.5;      ///< cosine: of a camera whose mounting is not known too badly
constexpr double kNearFlow = 2.0;     ///< start flows by which tracks have moved that alone are enough to begin

}  // namespace

void KeyframeTracker::start(const CameraFrame& frame) {
  if (stereo_ && !frame.right.empty()) {
    find_back(frame);
    start_stereo(frame);
  } else {
    start_mono(frame);
  }
}

/// The picture that a map is lost in is the first of the next one.
void KeyframeTracker::start_after(const std::string& loss, const CameraFrame& frame) {
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
    out_.state = without_map(frame.t_us, false);
    finish_bundle();
    map_.clear();
    front_end_->reset();
    return;
  }
  constexpr double kToldSpeedStd = 1.0;  // m/s, of what came with a restart
  const bool told = motion_ && !t_good_us_;
  begin_map(frame.t_us, told ? motion_ : std::nullopt, kToldSpeedStd * kToldSpeedStd * Matrix6d::Identity());
}

/// Waiting for the car to move is initialising; before a bare wall or in the dark a tracker is lost, also one that has
/// never had a map: whoever can give a pose should.
TrackState KeyframeTracker::without_map(int64_t t_us, bool able) {
  if (able || !t_able_us_) t_able_us_ = t_us;
  const bool lost = t_good_us_ || seconds_between(*t_able_us_, t_us) >= config_.lost_after_s;
  return lost ? TrackState::kLost : TrackState::kInitialising;
}

void KeyframeTracker::begin_map(int64_t t_us, const std::optional<FrameMotion>& motion, const Matrix6d& cov_motion) {
  if (t_good_us_) {  // after a loss: the way that nobody saw is missing
    continuous_ = found_back_;
    const double unseen_s = seconds_between(*t_good_us_, t_us);
    constexpr double kAcceleration = 1.0;  // m/s2: a car that is lost at a light drives on
    const double speed = motion_ && motion_->dt_s > 0.0 ? motion_->T_before_now.p.norm() / motion_->dt_s : 0.0;
    const double unseen = speed * unseen_s + 0.5 * kAcceleration * unseen_s * unseen_s;
    if (!found_back_) {
      constexpr double kTurnRate = 0.2;  // rad/s, a street corner, about the vehicle's up, as in arrive()
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
  t_able_us_.reset();
  out_.map_began = true;
  out_.state = found_back_ ? TrackState::kRelocalised : TrackState::kGood;
  out_.reason = found_back_ ? "found back at a place seen before" : "";
  found_back_ = false;
  settle(t_us, map_.last().T_map_camera, Matrix6d::Zero(), cov_motion);
}

int KeyframeTracker::count_landmarks(const std::vector<KeyframeFeature>& features) const {
  int count = 0;
  for (const KeyframeFeature& f : features) {
    const Landmark* landmark = map_.find(f.track);
    count += landmark != nullptr && landmark->p_map ? 1 : 0;
  }
  return count;
}

void KeyframeTracker::begin_start(const CameraFrame& frame, const std::vector<Feature>& features) {
  find_back(frame);
  start_ = MonoStart{};
  start_->t_us = frame.t_us;
  note_attitude(frame.t_us);
  std::vector<Feature> all = features;
  for (const Feature& f : front_end_->replenish()) {
    all.push_back(f);
    out_.features.push_back({f, FeatureUse::kNew});
  }
  for (const Feature& f : all) {
    if (const auto normalised = left_.unproject(f.pixel.cast<double>())) start_->seen[f.track] = *normalised;
  }
}

void KeyframeTracker::wait_for_parallax(int64_t t_us, size_t points) {
  const bool able = static_cast<int>(points) >= config_.start_points;
  out_.state = without_map(t_us, able);
  out_.reason = able ? "waiting for parallax" : "too few points in the picture";
}

void KeyframeTracker::start_mono(const CameraFrame& frame) {
  const std::vector<Feature> features = front_end_->track(frame.left, {});
  out_.num_expected = front_end_->num_expected();
  out_.num_matches = static_cast<int>(features.size());
  Pairs pairs;
  std::vector<double> flow;
  for (const Feature& f : features) {
    out_.features.push_back({f, FeatureUse::kMatched});
    const auto normalised = left_.unproject(f.pixel.cast<double>());
    if (!start_ || !start_->seen.contains(f.track) || !normalised) continue;
    pairs.tracks.push_back(f.track);
    pairs.first.push_back(start_->seen.at(f.track));
    pairs.second.push_back(*normalised);
    flow.push_back(left_.focal() * (pairs.second.back() - pairs.first.back()).norm());
  }
  if (!start_) {
    begin_start(frame, features);
    wait_for_parallax(frame.t_us, start_->seen.size());
    return;
  }
  wait_for_parallax(frame.t_us, pairs.tracks.size());
  if (flow.empty()) flow.push_back(0.0);
  std::nth_element(flow.begin(), flow.begin() + static_cast<std::ptrdiff_t>(flow.size() / 2), flow.end());
  if (flow.size() > 1 && flow[flow.size() / 2] < config_.standing_flow_px) note_attitude(frame.t_us);
  // What is near leaves the picture first and what stays moves little: rather a short way than none. Whether it is
  // long enough, the parallax of the points says.
  const bool last_chance = 2 * pairs.tracks.size() < start_->seen.size();
  // On a highway most of the picture is so far away that it stays and does not move: what is near counts there.
  const double near_px = kNearFlow * config_.start_flow_px;
  const auto near = std::count_if(flow.begin(), flow.end(), [near_px](double px) { return px >= near_px; });
  const bool enough = flow[flow.size() / 2] >= config_.start_flow_px || near >= config_.start_points;
  if (last_chance || enough) finish_start(frame, pairs);
  if (last_chance && map_.empty()) {
    begin_start(frame, features);
    wait_for_parallax(frame.t_us, start_->seen.size());
  }
}

void KeyframeTracker::finish_start(const CameraFrame& frame, const Pairs& pairs) {
  TwoViewConfig config;
  config.focal_px = left_.focal();
  config.gate_px = config_.gate_px;
  config.min_angle_deg = config_.min_parallax_deg;
  config.min_points = config_.start_points;
  const auto motion = two_view_motion(pairs.first, pairs.second, config);
  if (!motion) return;
  double baseline = 1.0;  // a unit of our own
  const double dt_s = seconds_between(start_->t_us, frame.t_us);
  const auto known = camera_travelled(start_->t_us, SE3{}, frame.t_us, motion->T_first_second);
  // Posts and lane marks that are taken for each other go backwards; a car as fast as that does not.
  const Eigen::Vector3d ahead = rig_.T_vehicle_left.q.conjugate() * Eigen::Vector3d::UnitX();
  const bool forwards = known && !known->travel.backwards && known->travel.distance > kFastestBack * dt_s;
  if (forwards && motion->T_first_second.p.dot(ahead) < -kClearly) return;
  if (known) {
    baseline = std::max(0.01, known->travel.distance);
    name_scale(*known);
  } else if (motion_ && motion_->dt_s > 0.0) {  // as fast as before the map was lost, or pulling away
    baseline = std::max({0.01, motion_->T_before_now.p.norm() / motion_->dt_s * dt_s, 0.5 * kUnseen * dt_s * dt_s});
  }
  std::vector<KeyframeFeature> first, second;
  pixels_.clear();
  std::vector<int64_t> wrong;
  auto used = out_.features.begin();  // in the order of the pairs
  for (size_t i = 0; i < pairs.tracks.size(); ++i) {
    while (used->feature.track != pairs.tracks[i]) ++used;
    used->use = motion->inlier[i] ? FeatureUse::kInlier : FeatureUse::kOutlier;
    if (motion->inlier[i]) {
      pixels_[pairs.tracks[i]] = used->feature.pixel;
      first.push_back({pairs.tracks[i], pairs.first[i], {}});
      second.push_back({pairs.tracks[i], pairs.second[i], {}});
    } else {
      wrong.push_back(pairs.tracks[i]);
    }
  }
  map_.add_keyframe({0, start_->t_us, T_map_camera_, {}, LensPull::Zero(), {}}, first);
  const SE3 T_map_second = T_map_camera_ * SE3{motion->T_first_second.q, baseline * motion->T_first_second.p};
  front_end_->drop(wrong);
  out_.num_landmarks_seen = static_cast<int>(pairs.tracks.size());
  out_.num_inliers = static_cast<int>(first.size());
  for (const Feature& f : front_end_->replenish()) {  // who comes into view now is wanted when the first ones leave it
    out_.features.push_back({f, FeatureUse::kNew});
    const auto normalised = left_.unproject(f.pixel.cast<double>());
    if (!normalised) continue;
    second.push_back({f.track, *normalised, {}});
    pixels_[f.track] = f.pixel;
  }
  map_.add_keyframe({0, frame.t_us, T_map_second, baseline, LensPull::Zero(), {}}, second);
  landmarks_at_keyframe_ = count_landmarks(second);
  cov_own_.setZero();
  cov_window_.setZero();
  begin_bundle();
  finish_bundle();
  const FrameMotion going{map_.keyframes().front().T_map_camera.inverse() * T_map_camera_, dt_s};
  start_.reset();
  // The mean of what may have been seconds: a car that pulls away is faster at their end.
  Matrix6d cov_going = cov_own_;
  const double slip = 0.5 * kUnseen * going.dt_s * going.dt_s;
  cov_going.topLeftCorner<3, 3>().diagonal().array() += slip * slip;
  begin_map(frame.t_us, going, cov_going);
}

}  // namespace roadfix
