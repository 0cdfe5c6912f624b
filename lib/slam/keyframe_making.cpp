/// Keyframes: when one is made, what is taken into the map with it, and its adjustment, begun here and taken in before
/// the next frame. And what holds the pose at a standstill that has left the map without landmarks.
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

#include "geometry/frames.h"
#include "slam/keyframe_tracker.h"
#include "slam/pose_covariance.h"
#include "slam/short_way.h"
#include "slam/triangulation.h"

namespace roadfix {
namespace {

constexpr double kStandingShare = 0.4;  ///< of a keyframe's landmarks, below which one is made at a standstill too
constexpr double kRipeShare = 0.5;    ///< tracks that could become points, over landmarks seen, that ask for a keyframe
constexpr double kFoundMemory = 0.8;  ///< how much of the share found after keyframes stays from one to the next
constexpr double kNoiseFlow = 1.67;   ///< sigmas: Rayleigh's median times root 2, a flow that is noise alone
constexpr double kMedianNoise = 1.77;    ///< of the middle of n shifts between two sightings, times sigma / sqrt(n)
constexpr double kWalkInMean = 3.0;      ///< a walk's variance at its end over that of its mean
constexpr double kLongestPull = 2.0;     ///< m: a fifth of the depth that (M.7b) thinks of
constexpr double kStandingDepth = 10.0;  ///< m, of what is seen: how far a car may have crept by so little flow

std::vector<double> lengths_of(const std::vector<Eigen::Vector2d>& shifts) {
  std::vector<double> lengths;
  for (const Eigen::Vector2d& shift : shifts) lengths.push_back(shift.norm());
  return lengths;
}

/// The upper one of two; of one number at least.
double median(std::vector<double> numbers) {
  const auto middle = numbers.begin() + static_cast<std::ptrdiff_t>(numbers.size() / 2);
  std::nth_element(numbers.begin(), middle, numbers.end());
  return *middle;
}

/// Median of each coordinate.
Eigen::Vector2d middle_of(const std::vector<Eigen::Vector2d>& shifts) {
  std::vector<double> x, y;
  for (const Eigen::Vector2d& shift : shifts) {
    x.push_back(shift.x());
    y.push_back(shift.y());
  }
  return {median(std::move(x)), median(std::move(y))};
}

}  // namespace

/// Motion of tracks since the last keyframe beyond what turning by q_now_keyframe makes, px.
std::vector<Eigen::Vector2d> KeyframeTracker::shifts_beyond(const Eigen::Quaterniond& q_now_keyframe,
                                                            const std::vector<Feature>& features) const {
  std::vector<Eigen::Vector2d> shifts;
  for (const Feature& f : features) {
    const Landmark* landmark = map_.find(f.track);
    if (landmark == nullptr || landmark->sightings.empty()) continue;
    const Sighting& seen = landmark->sightings.back();
    const auto now = left_.unproject(f.pixel.cast<double>());
    if (seen.keyframe != map_.last().id || !now) continue;
    const Eigen::Vector3d turned = q_now_keyframe * seen.left.homogeneous();
    shifts.emplace_back(left_.focal() * (*now - turned.hnormalized()));
  }
  return shifts;
}

/// Descriptors find half of what there is already in the next picture, flow nearly all of it. What is lost then tells
/// of the front end, only what is lost beyond it of the way.
void KeyframeTracker::learn_found_share() {
  if (!std::exchange(after_keyframe_, false) || landmarks_at_keyframe_ == 0) return;
  const double found = std::min(1.0, static_cast<double>(out_.num_inliers) / landmarks_at_keyframe_);
  found_share_ = kFoundMemory * found_share_ + (1.0 - kFoundMemory) * found;
}

/// Tracks without a point that the last keyframe saw and that have moved by a keyframe's way since.
int KeyframeTracker::num_ripe(const std::vector<Feature>& features) const {
  const Eigen::Quaterniond q_now_keyframe = T_map_camera_.q.conjugate() * map_.last().T_map_camera.q;
  std::vector<Feature> waiting;
  for (const Feature& f : features) {
    const Landmark* landmark = map_.find(f.track);
    if (landmark != nullptr && !landmark->p_map) waiting.push_back(f);
  }
  const std::vector<double> flows = lengths_of(shifts_beyond(q_now_keyframe, waiting));
  return static_cast<int>(
      std::count_if(flows.begin(), flows.end(), [&](double flow) { return flow > config_.keyframe_flow_px; }));
}

bool KeyframeTracker::needs_keyframe(const std::vector<Feature>& features) const {
  const Eigen::Quaterniond q_now_keyframe = T_map_camera_.q.conjugate() * map_.last().T_map_camera.q;
  std::vector<double> flows = lengths_of(shifts_beyond(q_now_keyframe, features));
  if (flows.empty()) return true;
  const double mean = std::accumulate(flows.begin(), flows.end(), 0.0) / static_cast<double>(flows.size());
  // Standing still tells nothing new, but what drives by covers tracks for good.
  const bool standing = median(std::move(flows)) < config_.standing_flow_px;
  const double share = standing ? kStandingShare : config_.keyframe_min_share;
  if (out_.num_inliers < share * found_share_ * landmarks_at_keyframe_) return true;
  if (static_cast<double>(num_ripe(features)) > kRipeShare * out_.num_inliers) return true;
  return !standing && mean > config_.keyframe_flow_px;
}

/// Without stereo no point is gained at a standstill, and what drives by covers those there are. That the picture
/// stands still says where the camera is all the same.
bool KeyframeTracker::hold(const CameraFrame& frame, const std::vector<Feature>& features) {
  const std::vector<Eigen::Vector2d> shifts = shifts_beyond(Eigen::Quaterniond::Identity(), features);
  if (static_cast<int>(shifts.size()) < config_.weak_inliers) return false;
  const bool few = static_cast<int>(shifts.size()) < 2 * config_.weak_inliers;
  const bool known = config_.standing_flow_px > 0.0;
  const double still_px = known ? std::hypot(config_.standing_flow_px, kNoiseFlow * config_.sigma_px) : 0.0;
  if (median(lengths_of(shifts)) >= still_px) return false;
  // A turn moves all tracks alike; going ahead does not.
  const double noise_px = kMedianNoise * config_.sigma_px / std::sqrt(static_cast<double>(shifts.size()));
  const double turn = std::hypot(middle_of(shifts).norm(), noise_px) / left_.focal();
  const double way = kStandingDepth * still_px / left_.focal();
  Vector6d variances;
  variances << Eigen::Vector3d::Constant(way * way), Eigen::Vector3d::Constant(turn * turn);
  out_.state = TrackState::kWeak;
  out_.reason = "standing, with few landmarks";
  accept(frame.t_us, map_.last().T_map_camera, variances.asDiagonal());
  if (few) make_keyframe(frame, features, StandingDoubt{way, turn});
  return true;
}

/// A car that pulls away from there has tracks without points still. They tell the turn, speeds how far it has gone,
/// and a car goes where it points: a pose, until the tracks have the parallax of points. (M.7b), (M.7c).
bool KeyframeTracker::pull_away(const CameraFrame& frame, const std::vector<Feature>& features) {
  const Keyframe& from = map_.last();
  const auto told = travelled(from.t_us, frame.t_us);
  const bool mono_with_scale = !stereo_ && scale_ != ScaleSource::kNone;
  if (!mono_with_scale || !told || out_.num_landmarks_seen >= config_.min_inliers) return false;
  if (told->travel.distance > kLongestPull) return false;
  std::vector<size_t> index;
  std::vector<Eigen::Vector2d> first, second;
  for (size_t i = 0; i < features.size(); ++i) {
    const Landmark* landmark = map_.find(features[i].track);
    const auto now = left_.unproject(features[i].pixel.cast<double>());
    if (landmark == nullptr || landmark->sightings.empty() || !now) continue;
    const Sighting& seen = landmark->sightings.back();
    if (seen.keyframe != from.id) continue;
    index.push_back(i);
    first.push_back(map_.lens().straighten(seen.left));
    second.push_back(map_.lens().straighten(*now));
  }
  const Eigen::Quaterniond q_start = from.T_map_camera.q.conjugate() * predict(frame.t_us).q;
  const double forward = told->travel.backwards ? -1.0 : 1.0;
  const Eigen::Vector3d ahead = rig_.T_vehicle_left.q.conjugate() * (forward * Eigen::Vector3d::UnitX());
  const ShortWayConfig config{left_.focal(), config_.sigma_px, config_.gate_px, config_.weak_inliers, ahead};
  const double length_sigma = std::max(kMinTravelSigma, told->travel.sigma);
  auto way = short_way(first, second, told->travel.distance, length_sigma, q_start, config);
  if (!way) return false;
  const auto of_camera = camera_travelled(from.t_us, SE3{}, frame.t_us, way->T_first_second);
  if (of_camera) way->T_first_second.p = of_camera->travel.distance * ahead;
  out_.state = TrackState::kWeak;
  out_.reason = "pulling away, with few landmarks";
  accept(frame.t_us, from.T_map_camera * way->T_first_second,
         in_map(way->cov_pose(length_sigma), {from.T_map_camera.q, {}, 1.0}));
  int points = 0;
  for (size_t k = 0; k < index.size(); ++k) {
    if (!way->inlier[k]) out_.features[index[k]].use = FeatureUse::kOutlier;
    const std::array<Ray, 2> rays{ray(SE3{}, first[k]), ray(way->T_first_second, second[k])};
    points += way->inlier[k] && triangulate(rays, config_.min_parallax_deg * kDegree) ? 1 : 0;
  }
  if (points < std::min(config_.start_points, static_cast<int>(index.size()) / 2)) return true;
  drop_wrong_tracks(features);
  make_keyframe(frame, features);
  return true;
}

/// What the right eye sees, for those who take the tracks.
void KeyframeTracker::show_right(const std::vector<Feature>& features,
                                 const std::vector<std::optional<Eigen::Vector2f>>& right) {
  auto used = out_.features.begin();
  for (size_t i = 0; i < features.size(); ++i) {  // both in ascending order of track
    while (used != out_.features.end() && used->feature.track < features[i].track) ++used;
    if (used != out_.features.end() && used->feature.track == features[i].track) used->right = right[i];
  }
}

void KeyframeTracker::make_keyframe(const CameraFrame& frame, const std::vector<Feature>& features,
                                    const std::optional<StandingDoubt>& stood) {
  std::vector<Feature> all;
  for (const Feature& f : features) {
    if (pixels_.contains(f.track)) all.push_back(f);
  }
  for (const Feature& f : front_end_->replenish()) {
    all.push_back(f);
    pixels_[f.track] = f.pixel;
    out_.features.push_back({f, FeatureUse::kNew});
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
    stereo_->set_extrinsics(map_.lens().turned(rig_.T_right_left));
    right = stereo_->match(frame.left, frame.right, queries);
    show_right(all, right);
  }
  std::vector<KeyframeFeature> seen;
  const Camera right_lens(rig_.right.value_or(rig_.left));
  for (size_t i = 0; i < all.size(); ++i) {
    const auto normalised = left_.unproject(all[i].pixel.cast<double>());
    if (!normalised) continue;
    seen.push_back({all[i].track, *normalised, {}});
    if (right[i]) seen.back().right = right_lens.unproject(right[i]->cast<double>());
  }
  const Keyframe keyframe{0, frame.t_us, T_map_camera_, {}, LensPull::Zero(), stood};
  if (!map_.empty()) {
    const SE3& T_map_before = map_.last().T_map_camera;
    const SE3 T_before_now = T_map_before.inverse() * T_map_camera_;
    cov_keyframe_ = carried(cov_keyframe_, T_map_before, T_before_now);
    cov_own_ = carried(cov_own_, T_map_before, T_before_now);
    cov_closed_ = carried(cov_closed_, loops_.S_map_odom().rigid() * T_map_before, T_before_now);
  }
  map_.add_keyframe(keyframe, seen);
  landmarks_at_keyframe_ = count_landmarks(seen);
  after_keyframe_ = true;
  begin_bundle();
  remember_place(frame, all);
}

void KeyframeTracker::begin_bundle() {
  job_ = std::make_unique<BundleJob>(map_.make_bundle([this](const Keyframe& a, const Keyframe& b) {
    if (stereo_ && !map_.one_eyed()) return std::optional<Travel>();
    const auto known = camera_travelled(a.t_us, a.T_map_camera, b.t_us, b.T_map_camera);
    if (!known) return std::optional<Travel>();
    if (stereo_) scale_std_ = known->travel.scale_std;
    return std::optional(known->travel);
  }));
  BundleJob* job = job_.get();
  const int iterations = config_.bundle_iterations;
  executor_.start([job, iterations] { job->report = adjust(job->problem, iterations); });
}

/// What a window hands on of its scale is off by what it has its own length wrong by, and the next ones begin with it:
/// a walk, (M.22a).
void KeyframeTracker::lose_scale(const BundleJob& job) {
  const BundleProblem& problem = job.problem;
  const bool told = std::any_of(problem.distances.begin(), problem.distances.end(),
                                [](const BundleProblem::Distance& d) { return d.measured; });
  if (told || (stereo_ && !map_.one_eyed())) return;
  const auto held = std::find_if(problem.views.rbegin(), problem.views.rend(), [](const auto& v) { return v.fixed; });
  if (held == problem.views.rbegin() || held == problem.views.rend()) return;
  const auto steps = static_cast<double>(held - problem.views.rbegin());
  const Eigen::Vector3d way = problem.views.back().T_map_camera.p - held->T_map_camera.p;
  const double length2 = way.squaredNorm();
  if (!(length2 > 0.0)) return;
  const double along = way.dot(job.report.clustered_cov_last.topLeftCorner<3, 3>() * way) / length2;
  const double lost = kWalkInMean * along / (length2 * steps);
  shared_.lose_scale(lost);
  shared_closed_.lose_scale(lost);
}

void KeyframeTracker::finish_bundle() {
  if (!job_) return;
  executor_.wait();
  const std::vector<int64_t> wrong = map_.apply(*job_);
  front_end_->drop(wrong);
  for (const int64_t track : wrong) pixels_.erase(track);
  T_map_camera_ = map_.last().T_map_camera;  // the frame before this one was the job's last keyframe
  // From the last keyframe held to the newest, (M.14).
  const auto& views = job_->problem.views;
  const auto steps = std::count_if(views.begin(), views.end(), [](const auto& view) { return !view.fixed; });
  const Matrix6d grown = job_->report.clustered_cov_last / static_cast<double>(std::max<ptrdiff_t>(1, steps));
  cov_keyframe_ += grown;
  cov_own_ += grown;
  lose_scale(*job_);
  cov_window_ = job_->report.clustered_cov_last;
  cov_closed_ += in_map(grown, loops_.S_map_odom());
  job_.reset();
}

}  // namespace roadfix
