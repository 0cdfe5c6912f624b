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

constexpr double kNoLoss = 0.99;  ///< share of what is known of the lens that a window may not take away
constexpr int64_t kBlink = 3;     ///< keyframes without the right eye that are no loss of it

/// Of the calibration before any picture. Two eyes tell depth by disparity, which every error of a lens resembles:
/// there only the right eye's turn is learnt.
LensCorrection::Matrix first_information(const KeyframeTrackerConfig& config, bool two_eyes) {
  const auto information = [&](double sigma) { return config.alike_sightings / std::max(1e-12, sigma * sigma); };
  LensCorrection::Vector diagonal;
  diagonal << information(two_eyes ? 0.0 : config.focal_std), information(two_eyes ? 0.0 : config.radial_std),
      Eigen::Vector3d::Constant(information(config.right_turn_std_deg * kDegree));
  return diagonal.asDiagonal();
}

}  // namespace

LocalMap::LocalMap(const CameraRig& rig, const KeyframeTrackerConfig& config)
    : rig_(rig),
      config_(config),
      focal_px_(Camera(rig.left).focal()),
      lens_information_(first_information(config, rig.right.has_value())) {}

/// Whoever has lost an eye is like mono: what turns tell of the lens counts, else they stretch the map. With both
/// eyes the lens is what the calibration says, again.
void LocalMap::count_eyes(std::span<const KeyframeFeature> features) {
  if (!rig_.right) return;
  const bool seen = std::any_of(features.begin(), features.end(), [](const auto& f) { return f.right.has_value(); });
  without_right_ = seen ? 0 : without_right_ + 1;
  if (one_eyed_ == (without_right_ >= kBlink)) return;
  one_eyed_ = !one_eyed_;
  constexpr int kLens = 2;  // focal length and radial distortion, the vector's first
  lens_information_.topRows<kLens>().setZero();
  lens_information_.leftCols<kLens>().setZero();
  lens_information_.topLeftCorner<kLens, kLens>() =
      first_information(config_, !one_eyed_).topLeftCorner<kLens, kLens>();
  lens_prior_.value.head<kLens>().setZero();
}

int64_t LocalMap::add_keyframe(const Keyframe& keyframe, std::span<const KeyframeFeature> features) {
  keyframes_.push_back(keyframe);
  keyframes_.back().id = next_id_;
  count_eyes(features);
  for (const KeyframeFeature& f : features) {
    landmarks_[f.track].sightings.push_back({next_id_, f.left, f.right});
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
    std::vector<Sighting>& sightings = it->second.sightings;
    std::erase_if(sightings, [&](const Sighting& s) { return s.keyframe < oldest; });
    // A track that the newest keyframe does not see has ended: without a point it will never get one.
    const bool ended = sightings.empty() || sightings.back().keyframe != newest;
    it = sightings.empty() || (ended && !it->second.p_map) ? landmarks_.erase(it) : std::next(it);
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
  const auto judge = [&](const Eye& eye, const Eigen::Vector2d& where) {
    const bool visible = eye.see(p_map, seen);
    worst = std::max(worst, visible ? focal_px_ * (seen - where).norm() : 1e9);
  };
  for (const Sighting& s : landmark.sightings) {
    const SE3& T_map_camera = keyframe(s.keyframe)->T_map_camera;
    judge(Eye(T_map_camera, lens_), s.left);
    if (s.right) judge(Eye(T_map_camera, lens_, rig_.T_right_left), *s.right);
  }
  return worst;
}

std::optional<Eigen::Vector3d> LocalMap::locate(const Landmark& landmark) const {
  std::vector<Ray> rays;
  const SE3 T_left_right = lens_.turned(rig_.T_right_left).inverse();
  for (const Sighting& s : landmark.sightings) {
    const SE3& T_map_camera = keyframe(s.keyframe)->T_map_camera;
    rays.push_back(ray(T_map_camera, lens_.straighten(s.left)));
    if (s.right) rays.push_back(ray(T_map_camera * T_left_right, lens_.straighten(*s.right)));
  }
  const bool stereo = landmark.sightings.back().right.has_value();
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

/// What is held was adjusted with the lens of then, and moves with it: all but the newest view held. And a sighting is
/// in as many windows as there are keyframes: beside all of them what is known must not drown. (M.13c), (M.15).
void LocalMap::free_lens(BundleProblem& problem, size_t fixed) const {
  const Keyframe& newest = keyframes_[fixed - 1];
  for (size_t i = 0; i < fixed; ++i) {
    const SE3 T_newest_held = newest.T_map_camera.inverse() * keyframes_[i].T_map_camera;
    problem.views[i].pull = keyframes_[i].pull - carried_by(newest.T_map_camera, T_newest_held) * newest.pull;
  }
  problem.lens_information *= static_cast<double>(keyframes_.size());
}

BundleJob LocalMap::make_bundle(const TravelBetween& travel) const {
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
  constexpr double kUnitHold = 1e-3;  // of the distance held: it is exact by definition
  for (size_t i = 0; i < keyframes_.size(); ++i) {
    const Keyframe& k = keyframes_[i];
    problem.views.push_back({k.T_map_camera, i < fixed});
    job.keyframes.push_back(k.id);
    if (i == 0) continue;
    const int view = static_cast<int>(i);
    if (k.stood) problem.standings.push_back({view - 1, view, *k.stood});
    if (const auto way = travel(keyframes_[i - 1], k)) {
      problem.distances.push_back({view - 1, view, way->distance, std::max(kMinTravelSigma, way->sigma), true});
    } else if (k.held_distance) {
      problem.distances.push_back({view - 1, view, *k.held_distance, kUnitHold * *k.held_distance});
    }
  }
  const bool two_eyes = rig_.right && !one_eyed_;
  const bool measured = std::any_of(problem.distances.begin(), problem.distances.end(),
                                    [](const BundleProblem::Distance& d) { return d.measured; });
  if (!two_eyes && measured) free_lens(problem, fixed);
  const int64_t first = keyframes_.front().id, first_free = first + static_cast<int64_t>(fixed);
  for (const auto& [track, landmark] : landmarks_) {
    const std::vector<Sighting>& seen = landmark.sightings;
    const bool several = seen.size() >= 2 || (seen.size() == 1 && seen.front().right);
    if (!landmark.p_map || !several || seen.back().keyframe < first_free) continue;
    const int point = static_cast<int>(problem.points.size());
    problem.points.push_back(*landmark.p_map);
    job.tracks.push_back(track);
    for (const Sighting& s : seen) {
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
      k.pull = job.report.pulls[i];
    }
  }
  for (size_t i = 0; i < job.tracks.size(); ++i) {
    const auto it = landmarks_.find(job.tracks[i]);
    if (it != landmarks_.end()) it->second.p_map = job.problem.points[i];
  }
  learn_lens(job);
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

void LocalMap::learn_lens(const BundleJob& job) {
  lens_ = lens_prior_ = job.problem.lens;
  // What this window added. The next windows share most of it: each counts for its share only, (M.15).
  const double share = 1.0 / static_cast<double>(job.keyframes.size());
  const LensCorrection::Matrix told = job.report.lens_cov.inverse() - job.problem.lens_information;
  const LensCorrection::Matrix added = share * 0.5 * (told + told.transpose());
  // Where a window has not come to its minimum its curvature may be none, and it tells nothing.
  const LensCorrection::Matrix sum = lens_information_ + added;
  const bool grows = Eigen::LLT<LensCorrection::Matrix>(sum - kNoLoss * lens_information_).info() == Eigen::Success;
  if (added.allFinite() && grows) lens_information_ = sum;
}

double LocalMap::focal_std() const {
  constexpr int kFocal = LensCorrection::kFocal;
  const LensCorrection::Matrix cov = config_.alike_sightings * lens_information_.inverse();
  return std::sqrt(cov(kFocal, kFocal));
}

void LocalMap::forget(std::span<const int64_t> tracks) {
  for (const int64_t track : tracks) landmarks_.erase(track);
}

void LocalMap::rescale(double factor) {
  const Eigen::Vector3d centre = keyframes_.back().T_map_camera.p;
  for (Keyframe& k : keyframes_) {
    k.T_map_camera.p = centre + factor * (k.T_map_camera.p - centre);
    if (k.held_distance) k.held_distance = factor * *k.held_distance;
    k.pull.topRows<3>() *= factor;
  }
  for (auto& [track, landmark] : landmarks_) {
    if (landmark.p_map) landmark.p_map = centre + factor * (*landmark.p_map - centre);
  }
}

void LocalMap::move(const SE3& T) {
  for (Keyframe& k : keyframes_) {
    k.T_map_camera = T * k.T_map_camera;
    k.pull.topRows<3>() = (T.R() * k.pull.topRows<3>()).eval();
  }
  for (auto& [track, landmark] : landmarks_) {
    if (landmark.p_map) landmark.p_map = T * *landmark.p_map;
  }
}

template <class Map, class Archive>
void LocalMap::members(Map& self, Archive& archive) {
  archive(self.next_id_, self.lens_.value, self.lens_prior_.value, self.lens_information_, self.keyframes_,
          self.landmarks_, self.without_right_, self.one_eyed_);
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
