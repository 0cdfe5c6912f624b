/// Creation of keyframes and their bundle adjustment, started here and applied before the next frame. And the pose at a
/// standstill that has left the map without landmarks.
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

#include "geometry/frames.h"
#include "slam/bearing_only_pose.h"
#include "slam/keyframe_tracker.h"
#include "slam/pose_covariance.h"
#include "slam/triangulation.h"

namespace roadfix {
namespace {

constexpr double kStandingShare = 0.4;   ///< of a keyframe's landmarks, below which a keyframe is made at a standstill
                                         ///< too
constexpr double kCandidateShare = 0.5;  ///< point candidates over observed landmarks that trigger a keyframe
constexpr double kRedetectionSmoothing = 0.8;  ///< filter constant of the redetection rate
constexpr double kNoiseFlow = 1.67;            ///< sigmas: Rayleigh median times root 2, of flow that is noise only
constexpr double kMedianNoise = 1.77;  ///< of the median of n shifts between two observations, times sigma / sqrt(n)
constexpr double kRandomWalkFactor = 3.0;        ///< variance of a random walk at its end over that of its mean
constexpr double kMaxBearingOnlyDistance = 2.0;  ///< m: a fifth of the depth assumed in (S.5.2)
constexpr double kStandingDepth = 10.0;          ///< m, assumed depth: possible motion for a given flow

std::vector<double> lengths_of(const std::vector<Eigen::Vector2d>& shifts) {
  std::vector<double> lengths;
  for (const Eigen::Vector2d& shift : shifts) lengths.push_back(shift.norm());
  return lengths;
}

/// Upper median; at least one element.
double median(std::vector<double> numbers) {
  const auto middle = numbers.begin() + static_cast<std::ptrdiff_t>(numbers.size() / 2);
  std::nth_element(numbers.begin(), middle, numbers.end());
  return *middle;
}

/// Median of each coordinate.
Eigen::Vector2d median_of(const std::vector<Eigen::Vector2d>& shifts) {
  std::vector<double> x, y;
  for (const Eigen::Vector2d& shift : shifts) {
    x.push_back(shift.x());
    y.push_back(shift.y());
  }
  return {median(std::move(x)), median(std::move(y))};
}

}  // namespace

/// Track motion since the last keyframe that the rotation q_now_keyframe does not explain, px.
std::vector<Eigen::Vector2d> KeyframeTracker::shifts_without_rotation(const Eigen::Quaterniond& q_now_keyframe,
                                                                      const std::vector<Feature>& features) const {
  std::vector<Eigen::Vector2d> shifts;
  for (const Feature& f : features) {
    const Landmark* landmark = map_.find(f.track);
    if (landmark == nullptr || landmark->observations.empty()) continue;
    const LandmarkObservation& seen = landmark->observations.back();
    const auto now = left_.unproject(f.pixel.cast<double>());
    if (seen.keyframe != map_.last().id || !now) continue;
    const Eigen::Vector3d turned = q_now_keyframe * seen.left.homogeneous();
    shifts.emplace_back(left_.focal() * (*now - turned.hnormalized()));
  }
  return shifts;
}

/// Descriptors redetect about half of the landmarks in the next image, optical flow nearly all. The rate is a property
/// of the front end; only a further loss is due to motion.
void KeyframeTracker::update_redetection_rate() {
  if (!std::exchange(after_keyframe_, false) || landmarks_at_keyframe_ == 0) return;
  const double found = std::min(1.0, static_cast<double>(out_.num_inliers) / landmarks_at_keyframe_);
  redetection_rate_ = kRedetectionSmoothing * redetection_rate_ + (1.0 - kRedetectionSmoothing) * found;
}

/// Tracks without a point, observed in the last keyframe, that have moved by keyframe_flow_px since.
int KeyframeTracker::num_point_candidates(const std::vector<Feature>& features) const {
  const Eigen::Quaterniond q_now_keyframe = T_map_camera_.q.conjugate() * map_.last().T_map_camera.q;
  std::vector<Feature> waiting;
  for (const Feature& f : features) {
    const Landmark* landmark = map_.find(f.track);
    if (landmark != nullptr && !landmark->p_map) waiting.push_back(f);
  }
  const std::vector<double> flows = lengths_of(shifts_without_rotation(q_now_keyframe, waiting));
  return static_cast<int>(
      std::count_if(flows.begin(), flows.end(), [&](double flow) { return flow > config_.keyframe_flow_px; }));
}

bool KeyframeTracker::needs_keyframe(const std::vector<Feature>& features) const {
  const Eigen::Quaterniond q_now_keyframe = T_map_camera_.q.conjugate() * map_.last().T_map_camera.q;
  std::vector<double> flows = lengths_of(shifts_without_rotation(q_now_keyframe, features));
  if (flows.empty()) return true;
  const double mean = std::accumulate(flows.begin(), flows.end(), 0.0) / static_cast<double>(flows.size());
  // A standstill adds no information, but passing vehicles end tracks.
  const bool standing = median(std::move(flows)) < config_.standing_flow_px;
  const double share = standing ? kStandingShare : config_.keyframe_min_share;
  if (out_.num_inliers < share * redetection_rate_ * landmarks_at_keyframe_) return true;
  if (static_cast<double>(num_point_candidates(features)) > kCandidateShare * out_.num_inliers) return true;
  return !standing && mean > config_.keyframe_flow_px;
}

/// At a standstill a monocular map gains no points, and passing vehicles end the existing ones. Static tracks still
/// determine the pose.
bool KeyframeTracker::hold_at_standstill(const CameraFrame& frame, const std::vector<Feature>& features) {
  const std::vector<Eigen::Vector2d> shifts = shifts_without_rotation(Eigen::Quaterniond::Identity(), features);
  if (static_cast<int>(shifts.size()) < config_.weak_inliers) return false;
  const bool few = static_cast<int>(shifts.size()) < 2 * config_.weak_inliers;
  const bool known = config_.standing_flow_px > 0.0;
  const double still_px = known ? std::hypot(config_.standing_flow_px, kNoiseFlow * config_.sigma_px) : 0.0;
  if (median(lengths_of(shifts)) >= still_px) return false;
  // A rotation moves all tracks alike; a translation does not.
  const double noise_px = kMedianNoise * config_.sigma_px / std::sqrt(static_cast<double>(shifts.size()));
  const double turn = std::hypot(median_of(shifts).norm(), noise_px) / left_.focal();
  const double displacement = kStandingDepth * still_px / left_.focal();
  Vector6d variances;
  variances << Eigen::Vector3d::Constant(displacement * displacement), Eigen::Vector3d::Constant(turn * turn);
  out_.state = TrackState::kWeak;
  out_.reason = "standing, with few landmarks";
  accept_pose(frame.t_us, map_.last().T_map_camera, variances.asDiagonal());
  if (few) make_keyframe(frame, features, StandstillSigma{displacement, turn});
  return true;
}

/// At a pull-away from there, tracks have no points yet: they determine the rotation, speeds the distance, and the
/// vehicle's forward axis the direction, until the tracks have the parallax for points. (S.5.2), (S.5.3).
bool KeyframeTracker::track_bearing_only(const CameraFrame& frame, const std::vector<Feature>& features) {
  const Keyframe& from = map_.last();
  const auto measured = measured_distance(from.t_us, frame.t_us);
  const bool mono_with_scale = !stereo_ && scale_ != ScaleSource::kNone;
  if (!mono_with_scale || !measured || out_.num_landmarks_seen >= config_.min_inliers) return false;
  if (measured->travelled.distance > kMaxBearingOnlyDistance) return false;
  std::vector<size_t> index;
  std::vector<Eigen::Vector2d> first, second;
  for (size_t i = 0; i < features.size(); ++i) {
    const Landmark* landmark = map_.find(features[i].track);
    const auto now = left_.unproject(features[i].pixel.cast<double>());
    if (landmark == nullptr || landmark->observations.empty() || !now) continue;
    const LandmarkObservation& seen = landmark->observations.back();
    if (seen.keyframe != from.id) continue;
    index.push_back(i);
    first.push_back(map_.lens().remove(seen.left));
    second.push_back(map_.lens().remove(*now));
  }
  const Eigen::Quaterniond q_start = from.T_map_camera.q.conjugate() * predict(frame.t_us).q;
  const double forward = measured->travelled.backwards ? -1.0 : 1.0;
  const Eigen::Vector3d ahead = rig_.T_vehicle_left.q.conjugate() * (forward * Eigen::Vector3d::UnitX());
  const BearingOnlyConfig config{left_.focal(), config_.sigma_px, config_.gate_px, config_.weak_inliers, ahead};
  const double length_sigma = std::max(kMinDistanceSigma, measured->travelled.sigma);
  auto pose = bearing_only_pose(first, second, measured->travelled.distance, length_sigma, q_start, config);
  if (!pose) return false;
  const auto of_camera = camera_distance(from.t_us, SE3{}, frame.t_us, pose->T_first_second);
  if (of_camera) pose->T_first_second.p = of_camera->travelled.distance * ahead;
  out_.state = TrackState::kWeak;
  out_.reason = "pulling away, with few landmarks";
  accept_pose(frame.t_us, from.T_map_camera * pose->T_first_second,
              rotated(pose->cov_pose(length_sigma), {from.T_map_camera.q, {}, 1.0}));
  int points = 0;
  for (size_t k = 0; k < index.size(); ++k) {
    if (!pose->inlier[k]) out_.features[index[k]].status = FeatureStatus::kOutlier;
    const std::array<Ray, 2> rays{ray(SE3{}, first[k]), ray(pose->T_first_second, second[k])};
    points += pose->inlier[k] && triangulate(rays, config_.min_parallax_deg * kDegree) ? 1 : 0;
  }
  if (points < std::min(config_.start_points, static_cast<int>(index.size()) / 2)) return true;
  drop_outlier_tracks(features);
  make_keyframe(frame, features);
  return true;
}

/// Records the right pixels for VO_FEATURES.
void KeyframeTracker::record_right_pixels(const std::vector<Feature>& features,
                                          const std::vector<std::optional<Eigen::Vector2f>>& right) {
  auto used = out_.features.begin();
  for (size_t i = 0; i < features.size(); ++i) {  // both in ascending order of track
    while (used != out_.features.end() && used->feature.track < features[i].track) ++used;
    if (used != out_.features.end() && used->feature.track == features[i].track) used->right = right[i];
  }
}

void KeyframeTracker::make_keyframe(const CameraFrame& frame, const std::vector<Feature>& features,
                                    const std::optional<StandstillSigma>& standstill) {
  std::vector<Feature> all;
  for (const Feature& f : features) {
    if (pixels_.contains(f.track)) all.push_back(f);
  }
  for (const Feature& f : front_end_->replenish()) {
    all.push_back(f);
    pixels_[f.track] = f.pixel;
    out_.features.push_back({f, FeatureStatus::kNew});
  }
  std::vector<std::optional<Eigen::Vector2f>> right(all.size());
  if (stereo_ && !frame.right.empty()) {
    const SE3 T_camera_map = T_map_camera_.inverse();
    std::vector<StereoQuery> queries;
    for (const Feature& f : all) {
      StereoQuery query{f.pixel, {}, f.track};
      const Landmark* landmark = map_.find(f.track);
      if (landmark != nullptr && landmark->p_map) {
        const double depth = (T_camera_map * *landmark->p_map).z();
        if (depth > kMinReprojectionDepth) query.depth = depth;
      }
      queries.push_back(query);
    }
    stereo_->set_extrinsics(map_.lens().corrected_extrinsics(rig_.T_right_left), map_.lens().right_decentring());
    right = stereo_->match(frame.left, frame.right, queries);
    record_right_pixels(all, right);
  }
  std::vector<KeyframeFeature> seen;
  const Camera right_lens(rig_.right.value_or(rig_.left));
  for (size_t i = 0; i < all.size(); ++i) {
    const auto normalised = left_.unproject(all[i].pixel.cast<double>());
    if (!normalised) continue;
    seen.push_back({all[i].track, *normalised, {}});
    if (right[i]) seen.back().right = right_lens.unproject(right[i]->cast<double>());
  }
  const Keyframe keyframe{0, frame.t_us, T_map_camera_, {}, LensSensitivity::Zero(), standstill};
  if (!map_.empty()) {
    const SE3& T_map_before = map_.last().T_map_camera;
    const SE3 T_before_now = T_map_before.inverse() * T_map_camera_;
    cov_keyframe_ = transported(cov_keyframe_, T_map_before, T_before_now);
    cov_own_ = transported(cov_own_, T_map_before, T_before_now);
    cov_closed_ = transported(cov_closed_, loops_.S_map_odom().rigid() * T_map_before, T_before_now);
  }
  map_.add_keyframe(keyframe, seen);
  landmarks_at_keyframe_ = count_landmarks(seen);
  after_keyframe_ = true;
  begin_bundle();
  add_place(frame, all);
}

void KeyframeTracker::begin_bundle() {
  job_ = std::make_unique<BundleJob>(map_.make_bundle([this](const Keyframe& a, const Keyframe& b) {
    if (stereo_ && !map_.right_camera_lost()) return std::optional<TravelledDistance>();
    const auto known = camera_distance(a.t_us, a.T_map_camera, b.t_us, b.T_map_camera);
    if (!known) return std::optional<TravelledDistance>();
    if (stereo_) scale_std_ = known->travelled.scale_std;
    return std::optional(known->travelled);
  }));
  BundleJob* job = job_.get();
  const int iterations = config_.bundle_iterations;
  executor_.start([job, iterations] { job->report = adjust(job->problem, iterations); });
}

/// The scale error of a window is inherited by the following ones: a random walk, (S.10.2).
void KeyframeTracker::add_scale_drift(const BundleJob& job) {
  const BundleProblem& problem = job.problem;
  const bool measured = std::any_of(problem.distances.begin(), problem.distances.end(),
                                    [](const BundleProblem::Distance& d) { return d.measured; });
  if (measured || (stereo_ && !map_.right_camera_lost())) return;
  const auto held = std::find_if(problem.views.rbegin(), problem.views.rend(), [](const auto& v) { return v.fixed; });
  if (held == problem.views.rbegin() || held == problem.views.rend()) return;
  const auto steps = static_cast<double>(held - problem.views.rbegin());
  const Eigen::Vector3d displacement = problem.views.back().T_map_camera.p - held->T_map_camera.p;
  const double length2 = displacement.squaredNorm();
  if (!(length2 > 0.0)) return;
  const double along = displacement.dot(job.report.clustered_cov_last.topLeftCorner<3, 3>() * displacement) / length2;
  const double lost = kRandomWalkFactor * along / (length2 * steps);
  considered_.add_scale_drift(lost);
  considered_closed_.add_scale_drift(lost);
}

void KeyframeTracker::finish_bundle() {
  if (!job_) return;
  executor_.wait();
  const std::vector<int64_t> wrong = map_.apply(*job_);
  front_end_->drop(wrong);
  for (const int64_t track : wrong) pixels_.erase(track);
  T_map_camera_ = map_.last().T_map_camera;  // the previous frame was the job's last keyframe
  // From the last fixed keyframe to the newest, (S.9.1).
  const auto& views = job_->problem.views;
  const auto steps = std::count_if(views.begin(), views.end(), [](const auto& view) { return !view.fixed; });
  const Matrix6d grown = job_->report.clustered_cov_last / static_cast<double>(std::max<ptrdiff_t>(1, steps));
  cov_keyframe_ += grown;
  cov_own_ += grown;
  add_scale_drift(*job_);
  cov_window_ = job_->report.clustered_cov_last;
  cov_closed_ += rotated(grown, loops_.S_map_odom());
  job_.reset();
}

}  // namespace roadfix
