#include "slam/local_map.h"

#include <algorithm>
#include <cmath>

#include "geometry/frames.h"
#include "slam/pose_covariance.h"
#include "slam/reprojection.h"
#include "slam/state_io.h"
#include "slam/triangulation.h"

namespace roadfix {
namespace {

constexpr double kMinRetainedInformation = 0.99;  ///< of the lens information, for a window to be accepted
constexpr int64_t kMinMissing = 3;  ///< keyframes without a right image before the rig counts as monocular

/// Prior of the calibration correction. In stereo, depth comes from disparity and focal length or distortion are not
/// separable from it: only the rotation of the right camera is estimated.
LensCorrection::Matrix prior_information(const KeyframeTrackerConfig& config, bool stereo) {
  const auto information = [&](double sigma) {
    return config.correlated_observations / std::max(1e-12, sigma * sigma);
  };
  LensCorrection::Vector diagonal;
  diagonal << information(stereo ? 0.0 : config.focal_std), information(stereo ? 0.0 : config.radial_std),
      Eigen::Vector3d::Constant(information(config.right_turn_std_deg * kDegree)),
      Eigen::Vector2d::Constant(information(config.right_decentring_std));
  return diagonal.asDiagonal();
}

}  // namespace

LocalMap::LocalMap(const CameraRig& rig, const KeyframeTrackerConfig& config)
    : rig_(rig),
      config_(config),
      focal_px_(Camera(rig.left).focal()),
      lens_information_(prior_information(config, rig.right.has_value())) {}

/// Without its right camera a rig is treated as monocular: focal length and distortion are estimated, else they distort
/// the map. With both cameras they are as calibrated again.
void LocalMap::update_right_camera(std::span<const KeyframeFeature> features) {
  if (!rig_.right) return;
  const bool seen = std::any_of(features.begin(), features.end(), [](const auto& f) { return f.right.has_value(); });
  keyframes_without_right_ = seen ? 0 : keyframes_without_right_ + 1;
  if (right_camera_lost_ == (keyframes_without_right_ >= kMinMissing)) return;
  right_camera_lost_ = !right_camera_lost_;
  constexpr int kLens = 2;  // focal length and radial distortion, the first components
  lens_information_.topRows<kLens>().setZero();
  lens_information_.leftCols<kLens>().setZero();
  lens_information_.topLeftCorner<kLens, kLens>() =
      prior_information(config_, !right_camera_lost_).topLeftCorner<kLens, kLens>();
  lens_prior_.value.head<kLens>().setZero();
}

int64_t LocalMap::add_keyframe(const Keyframe& keyframe, std::span<const KeyframeFeature> features) {
  keyframes_.push_back(keyframe);
  keyframes_.back().id = next_id_;
  update_right_camera(features);
  for (const KeyframeFeature& f : features) {
    landmarks_[f.track].observations.push_back({next_id_, f.left, f.right});
  }
  forget_old_keyframes();
  make_points();
  return next_id_++;
}

void LocalMap::forget_old_keyframes() {
  const auto keep = static_cast<size_t>(config_.window + config_.window_fixed);
  while (keyframes_.size() > keep) keyframes_.pop_front();
  const int64_t oldest = keyframes_.front().id, newest = keyframes_.back().id;
  for (auto it = landmarks_.begin(); it != landmarks_.end();) {
    std::vector<LandmarkObservation>& observations = it->second.observations;
    std::erase_if(observations, [&](const LandmarkObservation& s) { return s.keyframe < oldest; });
    // A track not observed by the newest keyframe has ended: without a point it will not get one.
    const bool ended = observations.empty() || observations.back().keyframe != newest;
    it = observations.empty() || (ended && !it->second.p_map) ? landmarks_.erase(it) : std::next(it);
  }
}

const Keyframe* LocalMap::keyframe(int64_t id) const {
  const int64_t first = keyframes_.front().id;
  if (id < first || id > keyframes_.back().id) return nullptr;
  return &keyframes_[static_cast<size_t>(id - first)];
}

const Landmark* LocalMap::find(int64_t track) const {
  const auto it = landmarks_.find(track);
  return it == landmarks_.end() ? nullptr : &it->second;
}

double LocalMap::worst_error_px(const Landmark& landmark, const Eigen::Vector3d& p_map) const {
  double worst = 0.0;
  Eigen::Vector2d seen;
  const auto check = [&](const PosedCamera& camera, const Eigen::Vector2d& where) {
    const bool visible = camera.project(p_map, seen);
    worst = std::max(worst, visible ? focal_px_ * (seen - where).norm() : 1e9);
  };
  for (const LandmarkObservation& s : landmark.observations) {
    const SE3& T_map_camera = keyframe(s.keyframe)->T_map_camera;
    check(PosedCamera(T_map_camera, lens_), s.left);
    if (s.right) check(PosedCamera(T_map_camera, lens_, rig_.T_right_left), *s.right);
  }
  return worst;
}

std::optional<Eigen::Vector3d> LocalMap::locate(const Landmark& landmark) const {
  std::vector<Ray> rays;
  const SE3 T_left_right = lens_.corrected_extrinsics(rig_.T_right_left).inverse();
  for (const LandmarkObservation& s : landmark.observations) {
    const SE3& T_map_camera = keyframe(s.keyframe)->T_map_camera;
    rays.push_back(ray(T_map_camera, lens_.remove(s.left)));
    if (s.right) rays.push_back(ray(T_map_camera * T_left_right, lens_.remove_right(*s.right)));
  }
  const bool stereo = landmark.observations.back().right.has_value();
  const double angle = stereo ? config_.min_disparity_px / focal_px_ : config_.min_parallax_deg * kDegree;
  auto p = triangulate(rays, angle);
  if (!p || worst_error_px(landmark, *p) > config_.gate_px) return std::nullopt;
  return p;
}

void LocalMap::make_points() {
  for (auto& [track, landmark] : landmarks_) {
    if (!landmark.p_map) landmark.p_map = locate(landmark);
  }
}

size_t LocalMap::num_fixed() const {
  const auto window = static_cast<size_t>(config_.window);
  return keyframes_.size() > window + 1 ? keyframes_.size() - window : 1;
}

/// Fixed views were adjusted with an earlier lens and move with it, except the newest one. An observation is part of as
/// many windows as there are keyframes: the prior is weighted accordingly. (S.7.14), (S.8.1).
void LocalMap::link_fixed_views_to_lens(BundleProblem& problem, size_t fixed) const {
  const Keyframe& newest = keyframes_[fixed - 1];
  for (size_t i = 0; i < fixed; ++i) {
    const SE3 T_newest_held = newest.T_map_camera.inverse() * keyframes_[i].T_map_camera;
    problem.views[i].lens_sensitivity =
        keyframes_[i].lens_sensitivity -
        pose_transport_jacobian(newest.T_map_camera, T_newest_held) * newest.lens_sensitivity;
  }
  problem.lens_information *= static_cast<double>(keyframes_.size());
}

BundleJob LocalMap::make_bundle(const DistanceBetween& travel) const {
  BundleJob job;
  BundleProblem& problem = job.problem;
  problem.T_right_left = rig_.T_right_left;
  problem.focal_px = focal_px_;
  problem.sigma_px = config_.sigma_px;
  problem.track_freedom = config_.track_freedom;
  problem.lens = lens_;
  problem.lens_prior = lens_prior_;
  problem.lens_information = lens_information_;
  const size_t fixed = num_fixed();
  constexpr double kUnitSigma = 1e-3;  // of the reference distance, which is exact by definition
  for (size_t i = 0; i < keyframes_.size(); ++i) {
    const Keyframe& k = keyframes_[i];
    problem.views.push_back({k.T_map_camera, i < fixed});
    job.keyframes.push_back(k.id);
    if (i == 0) continue;
    const int view = static_cast<int>(i);
    if (k.standstill) problem.standstills.push_back({view - 1, view, *k.standstill});
    if (const auto travelled = travel(keyframes_[i - 1], k)) {
      problem.distances.push_back(
          {view - 1, view, travelled->distance, std::max(kMinDistanceSigma, travelled->sigma), true});
    } else if (k.reference_distance) {
      problem.distances.push_back({view - 1, view, *k.reference_distance, kUnitSigma * *k.reference_distance});
    }
  }
  const bool stereo = rig_.right && !right_camera_lost_;
  const bool measured = std::any_of(problem.distances.begin(), problem.distances.end(),
                                    [](const BundleProblem::Distance& d) { return d.measured; });
  if (!stereo && measured) link_fixed_views_to_lens(problem, fixed);
  const int64_t first = keyframes_.front().id, first_free = first + static_cast<int64_t>(fixed);
  for (const auto& [track, landmark] : landmarks_) {
    const std::vector<LandmarkObservation>& seen = landmark.observations;
    const bool several = seen.size() >= 2 || (seen.size() == 1 && seen.front().right);
    if (!landmark.p_map || !several || seen.back().keyframe < first_free) continue;
    const int point = static_cast<int>(problem.points.size());
    problem.points.push_back(*landmark.p_map);
    job.tracks.push_back(track);
    for (const LandmarkObservation& s : seen) {
      const int view = static_cast<int>(s.keyframe - first);
      problem.observations.push_back({view, point, false, s.left});
      if (s.right) problem.observations.push_back({view, point, true, *s.right});
    }
  }
  return job;
}

std::vector<int64_t> LocalMap::apply(const BundleJob& job) {
  for (size_t i = 0; i < job.keyframes.size(); ++i) {
    for (Keyframe& k : keyframes_) {
      if (k.id != job.keyframes[i]) continue;
      k.T_map_camera = job.problem.views[i].T_map_camera;
      k.lens_sensitivity = job.report.lens_sensitivities[i];
    }
  }
  for (size_t i = 0; i < job.tracks.size(); ++i) {
    const auto it = landmarks_.find(job.tracks[i]);
    if (it != landmarks_.end()) it->second.p_map = job.problem.points[i];
  }
  update_lens(job);
  std::vector<int64_t> wrong;
  for (size_t i = 0; i < job.report.error_px.size(); ++i) {
    if (job.report.error_px[i] <= config_.gate_px) continue;
    const BundleProblem::Observation& o = job.problem.observations[i];
    const int64_t track = job.tracks[static_cast<size_t>(o.point)];
    if (wrong.empty() || wrong.back() != track) wrong.push_back(track);
  }
  forget(wrong);
  return wrong;
}

void LocalMap::update_lens(const BundleJob& job) {
  lens_ = lens_prior_ = job.problem.lens;
  // Information gained from this window, which overlaps the next ones: only its share counts, (S.8.1).
  const double share = 1.0 / static_cast<double>(job.keyframes.size());
  const LensCorrection::Matrix difference = job.report.lens_cov.inverse() - job.problem.lens_information;
  const LensCorrection::Matrix added = share * 0.5 * (difference + difference.transpose());
  // A window that has not converged may have negative curvature: it is ignored.
  const LensCorrection::Matrix sum = lens_information_ + added;
  const bool grows =
      Eigen::LLT<LensCorrection::Matrix>(sum - kMinRetainedInformation * lens_information_).info() == Eigen::Success;
  if (added.allFinite() && grows) lens_information_ = sum;
}

double LocalMap::focal_std() const {
  constexpr int kFocal = LensCorrection::kFocal;
  const LensCorrection::Matrix cov = config_.correlated_observations * lens_information_.inverse();
  return std::sqrt(cov(kFocal, kFocal));
}

void LocalMap::forget(std::span<const int64_t> tracks) {
  for (const int64_t track : tracks) landmarks_.erase(track);
}

void LocalMap::rescale(double factor) {
  const Eigen::Vector3d centre = keyframes_.back().T_map_camera.p;
  for (Keyframe& k : keyframes_) {
    k.T_map_camera.p = centre + factor * (k.T_map_camera.p - centre);
    if (k.reference_distance) k.reference_distance = factor * *k.reference_distance;
    k.lens_sensitivity.topRows<3>() *= factor;
  }
  for (auto& [track, landmark] : landmarks_) {
    if (landmark.p_map) landmark.p_map = centre + factor * (*landmark.p_map - centre);
  }
}

void LocalMap::move(const SE3& T) {
  for (Keyframe& k : keyframes_) {
    k.T_map_camera = T * k.T_map_camera;
    k.lens_sensitivity.topRows<3>() = (T.R() * k.lens_sensitivity.topRows<3>()).eval();
  }
  for (auto& [track, landmark] : landmarks_) {
    if (landmark.p_map) landmark.p_map = T * *landmark.p_map;
  }
}

template <class Map, class Archive>
void LocalMap::members(Map& self, Archive& archive) {
  archive(self.next_id_, self.lens_.value, self.lens_prior_.value, self.lens_information_, self.keyframes_,
          self.landmarks_, self.keyframes_without_right_, self.right_camera_lost_);
}

void LocalMap::save(StateWriter& writer) const {
  SavingArchive archive(writer);
  members(*this, archive);
}

void LocalMap::load(StateReader& reader) {
  LoadingArchive archive(reader);
  members(*this, archive);
}

void LocalMap::clear() {
  keyframes_.clear();
  landmarks_.clear();
}

}  // namespace roadfix
