#include "slam/local_mapping.h"

#include <algorithm>
#include <utility>

#include "slam/pose_covariance.h"
#include "slam/reprojection.h"
#include "slam/state_io.h"

namespace roadfix {
namespace {

constexpr double kRandomWalkFactor = 3.0;  ///< variance of a random walk at its end over that of its mean
constexpr double kMinScaleDistance = 3.0;  ///< m, distance required before speeds set the scale of a map
constexpr double kKeypointDrift = 2.0;     ///< of FAST and of networks, over that of patches and SIFT (EVIDENCE.md)

/// rad/m, (S.10.4)
double drift_of(const KeyframeTrackerConfig& config) {
  const FrontEndKind kind = config.front_end.kind;
  const bool lasting = kind == FrontEndKind::kKlt || kind == FrontEndKind::kSift;
  return (lasting ? 1.0 : kKeypointDrift) * config.drift;
}

}  // namespace

LocalMapping::LocalMapping(const KeyframeTrackerConfig& config, const CameraRig& rig,
                           std::unique_ptr<RightImageMatcher> matcher, Executor& executor)
    : rig_(rig),
      bundle_iterations_(config.bundle_iterations),
      drift_(drift_of(config)),
      left_(rig.left),
      right_(rig.right.value_or(rig.left)),
      matcher_(std::move(matcher)),
      executor_(executor),
      map_(rig, config) {}

std::vector<std::optional<Eigen::Vector2f>> LocalMapping::match_right(const CameraFrame& frame, const SE3& T_map_camera,
                                                                      std::span<const Feature> features) {
  if (!stereo() || frame.right.empty()) return std::vector<std::optional<Eigen::Vector2f>>(features.size());
  const SE3 T_camera_map = T_map_camera.inverse();
  std::vector<StereoQuery> queries;
  for (const Feature& f : features) {
    StereoQuery query{f.pixel, {}, f.track};
    const Landmark* landmark = map_.find(f.track);
    if (landmark != nullptr && landmark->p_map) {
      const double depth = (T_camera_map * *landmark->p_map).z();
      if (depth > kMinReprojectionDepth) query.depth = depth;
    }
    queries.push_back(query);
  }
  matcher_->set_extrinsics(map_.lens().corrected_extrinsics(rig_.T_right_left), map_.lens().right_decentring());
  return matcher_->match(frame.left, frame.right, queries);
}

int LocalMapping::insert(const Keyframe& keyframe, std::span<const KeyframeFeature> features) {
  if (map_.empty()) {
    begun_us_ = keyframe.t_us;
    cov_own_.setZero();
    cov_passing_.setZero();
  } else {
    const SE3& T_map_before = map_.last().T_map_camera;
    cov_own_ = transported(cov_own_, T_map_before, T_map_before.inverse() * keyframe.T_map_camera);
  }
  map_.add_keyframe(keyframe, features);
  return static_cast<int>(std::count_if(features.begin(), features.end(), [this](const KeyframeFeature& f) {
    const Landmark* landmark = map_.find(f.track);
    return landmark != nullptr && landmark->p_map;
  }));
}

NewKeyframe LocalMapping::add_keyframe(const CameraFrame& frame, const SE3& T_map_camera,
                                       std::span<const Feature> features,
                                       const std::optional<StandstillSigma>& standstill,
                                       const DistancePrior& distance) {
  NewKeyframe added;
  added.right = match_right(frame, T_map_camera, features);
  std::vector<KeyframeFeature> seen;
  for (size_t i = 0; i < features.size(); ++i) {
    const auto normalised = left_.unproject(features[i].pixel.cast<double>());
    if (!normalised) continue;
    seen.push_back({features[i].track, *normalised, {}});
    if (added.right[i]) seen.back().right = right_.unproject(added.right[i]->cast<double>());
  }
  added.num_landmarks = insert({0, frame.t_us, T_map_camera, {}, LensSensitivity::Zero(), standstill}, seen);
  start_adjustment(distance);
  return added;
}

int LocalMapping::add_two_views(const TwoViewMap& views, const DistancePrior& distance) {
  if (views.measured) set_scale(*views.measured);
  insert(views.first, views.first_features);
  const int num_landmarks = insert(views.second, views.second_features);
  begun_us_ = views.second.t_us;
  start_adjustment(distance);
  return num_landmarks;
}

InitialMotion LocalMapping::initial_motion() const {
  const Keyframe &first = map_.keyframes().front(), &second = map_.last();
  InitialMotion initial{{first.T_map_camera.inverse() * second.T_map_camera, seconds_between(first.t_us, second.t_us)},
                        cov_own_};
  const double slip = unmeasured_displacement(initial.motion.dt_s);
  initial.cov.topLeftCorner<3, 3>().diagonal().array() += slip * slip;
  return initial;
}

void LocalMapping::start_adjustment(const DistancePrior& distance) {
  job_ = std::make_unique<BundleJob>(map_.make_bundle([&](const Keyframe& a, const Keyframe& b) {
    if (stereo() && !map_.right_camera_lost()) return std::optional<TravelledDistance>();
    const auto known = distance.of_camera(a.t_us, a.T_map_camera, b.t_us, b.T_map_camera);
    if (!known) return std::optional<TravelledDistance>();
    if (stereo()) scale_std_ = known->travelled.scale_std;
    return std::optional(known->travelled);
  }));
  executor_.start(
      [job = job_.get(), iterations = bundle_iterations_] { job->report = adjust(job->problem, iterations); });
}

std::optional<MapAdjustment> LocalMapping::finish_adjustment() {
  if (!job_) return std::nullopt;
  executor_.wait();
  const auto job = std::exchange(job_, nullptr);
  MapAdjustment result;
  result.outliers = map_.apply(*job);
  const auto& views = job->problem.views;
  const auto first = std::find_if(views.begin(), views.end(), [](const auto& view) { return !view.fixed; });
  if (first != views.end()) {
    // What the first has wrong each later one will have when it is the first.
    const SE3& T_map_newest = views.back().T_map_camera;
    Matrix6d adds_up = Matrix6d::Zero();
    for (auto view = views.end(); view-- != first;) {
      const SE3& T_map_view = view->T_map_camera;
      const Matrix6d own = at_pose(job->report.clustered_cov_first, first->T_map_camera, T_map_view);
      result.cov_keyframe = transported(own, T_map_view, T_map_view.inverse() * T_map_newest);
      adds_up += result.cov_keyframe;
    }
    cov_passing_ = besides(job->report.clustered_cov_last, adds_up, T_map_newest);
  }
  result.scale_drift = scale_drift(*job);
  cov_own_ += result.cov_keyframe;
  return result;
}

/// The scale error of a window is inherited by the following ones: a random walk, (S.10.2).
double LocalMapping::scale_drift(const BundleJob& job) const {
  const BundleProblem& problem = job.problem;
  const bool measured = std::any_of(problem.distances.begin(), problem.distances.end(),
                                    [](const BundleProblem::Distance& d) { return d.measured; });
  if (measured || (stereo() && !map_.right_camera_lost())) return 0.0;
  const auto held = std::find_if(problem.views.rbegin(), problem.views.rend(), [](const auto& v) { return v.fixed; });
  if (held == problem.views.rbegin() || held == problem.views.rend()) return 0.0;
  const auto steps = static_cast<double>(held - problem.views.rbegin());
  const Eigen::Vector3d displacement = problem.views.back().T_map_camera.p - held->T_map_camera.p;
  const double length2 = displacement.squaredNorm();
  if (!(length2 > 0.0)) return 0.0;
  const double along = displacement.dot(job.report.clustered_cov_last.topLeftCorner<3, 3>() * displacement) / length2;
  return kRandomWalkFactor * along / (length2 * steps);
}

void LocalMapping::set_scale(const MeasuredDistance& measured) {
  scale_ = measured.source == SpeedSource::kIns ? ScaleSource::kIns : ScaleSource::kWheels;
  scale_std_ = measured.travelled.scale_std;
}

std::optional<ScaleMeasurement> LocalMapping::measure_scale(const DistancePrior& distance) {
  if (stereo() || map_.keyframes().size() < 2) return std::nullopt;
  const Keyframe& newest = map_.last();
  for (const Keyframe& k : map_.keyframes()) {
    const double length = (newest.T_map_camera.p - k.T_map_camera.p).norm();
    const auto known = distance.of_camera(k.t_us, k.T_map_camera, newest.t_us, newest.T_map_camera);
    if (!known || !(length > 0.0)) continue;
    ScaleMeasurement measured;
    if (scale_ == ScaleSource::kNone) {
      const TravelledDistance& travelled = known->travelled;
      if (!(travelled.distance > kMinScaleDistance && travelled.sigma < 0.1 * travelled.distance)) return std::nullopt;
      measured.factor = travelled.distance / length;
      map_.rescale(*measured.factor);
    }
    set_scale(*known);
    return measured;
  }
  return std::nullopt;
}

ScaleSigmas LocalMapping::scale_sigmas() const {
  const ScaleSigmas& rig = rig_.scale_sigmas;
  if (stereo() && !map_.right_camera_lost()) return {rig.length, rig.rotation, drift_};
  const double focal = map_.focal_std();
  if (stereo()) return {std::max(rig.length, scale_std_), std::max(rig.rotation, focal), drift_};
  return {scale_ == ScaleSource::kNone ? 0.0 : scale_std_, focal, drift_};
}

void LocalMapping::move(const SE3& T_new_old) {
  map_.move(T_new_old);
  cov_own_ = rotated(cov_own_, {T_new_old.q, {}, 1.0});
  cov_passing_ = rotated(cov_passing_, {T_new_old.q, {}, 1.0});
}

template <class Mapping, class Archive>
void LocalMapping::members(Mapping& self, Archive& archive) {
  archive(self.map_, self.begun_us_, self.cov_own_, self.cov_passing_, self.scale_, self.scale_std_);
}

void LocalMapping::save(StateWriter& writer) const {
  SavingArchive archive(writer);
  members(*this, archive);
  writer.put(job_ != nullptr);
}

void LocalMapping::load(StateReader& reader, const DistancePrior& distance) {
  executor_.wait();
  job_.reset();
  LoadingArchive archive(reader);
  members(*this, archive);
  if (reader.get<bool>()) start_adjustment(distance);
}

}  // namespace roadfix
