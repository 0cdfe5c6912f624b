#include "slam/feature_tracks.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <utility>

#include "slam/reprojection.h"
#include "slam/state_io.h"

namespace roadfix {

FeatureTracks::FeatureTracks(std::unique_ptr<FrontEnd> front_end, const Camera& camera, const Eigen::Vector3d& travel)
    : front_end_(std::move(front_end)), camera_(camera) {
  front_end_->set_camera(camera, travel);
}

std::vector<Feature> FeatureTracks::track(const cv::Mat& gray, const LocalMap& map, const SE3& T_map_camera,
                                          const SE3& T_predicted) {
  std::vector<Feature> features = front_end_->track(gray, predicted(map, T_map_camera, T_predicted));
  pixels_.clear();
  for (const Feature& f : features) activate(f);
  return features;
}

std::vector<Feature> FeatureTracks::active(std::span<const Feature> features) const {
  std::vector<Feature> active;
  std::copy_if(features.begin(), features.end(), std::back_inserter(active),
               [this](const Feature& f) { return pixels_.contains(f.track); });
  return active;
}

void FeatureTracks::drop(std::span<const int64_t> tracks) {
  front_end_->drop(tracks);
  for (const int64_t track : tracks) pixels_.erase(track);
}

void FeatureTracks::reset() {
  front_end_->reset();
  pixels_.clear();
}

std::optional<Eigen::Vector2d> FeatureTracks::project(const Eigen::Vector3d& p_camera,
                                                      const LensCorrection& lens) const {
  if (!(p_camera.z() > kMinReprojectionDepth)) return std::nullopt;
  return camera_.distort(lens.apply(p_camera.hnormalized()));
}

/// Pixels and inverse depths of the points in the last image.
std::vector<FeatureTracks::KnownDepth> FeatureTracks::known_depths(const LocalMap& map, const SE3& T_camera_map) const {
  std::vector<KnownDepth> known;
  for (const auto& [track, pixel] : pixels_) {
    const Landmark* landmark = map.find(track);
    if (landmark == nullptr || !landmark->p_map) continue;
    const double depth = (T_camera_map * *landmark->p_map).z();
    if (depth > kMinReprojectionDepth) known.push_back({pixel, 1.0 / depth});
  }
  return known;
}

/// A track without a point is predicted with the depth of the nearest track with one, else at infinity.
double FeatureTracks::inverse_depth_near(const Eigen::Vector2f& pixel, std::span<const KnownDepth> known) {
  double inverse_depth = 0.0;
  float nearest = std::numeric_limits<float>::infinity();
  for (const KnownDepth& k : known) {
    const float distance = (k.pixel - pixel).squaredNorm();
    if (distance >= nearest) continue;
    nearest = distance;
    inverse_depth = k.inverse_depth;
  }
  return inverse_depth;
}

std::vector<Feature> FeatureTracks::predicted(const LocalMap& map, const SE3& T_map_camera,
                                              const SE3& T_predicted) const {
  std::vector<Feature> out;
  const SE3 T_camera_map = T_predicted.inverse();
  const SE3 T_now_before = T_camera_map * T_map_camera;
  const std::vector<KnownDepth> known = known_depths(map, T_map_camera.inverse());
  for (const auto& [track, pixel] : pixels_) {
    const Landmark* landmark = map.find(track);
    std::optional<Eigen::Vector2d> expected;
    if (landmark != nullptr && landmark->p_map) {
      expected = project(T_camera_map * *landmark->p_map, map.lens());
    } else if (const auto before = camera_.unproject(pixel.cast<double>())) {
      const Eigen::Vector3d direction = map.lens().remove(*before).homogeneous();
      expected = project(T_now_before.q * direction + inverse_depth_near(pixel, known) * T_now_before.p, map.lens());
    }
    if (expected) out.push_back({track, expected->cast<float>()});
  }
  // Landmarks not detected in the last images: a descriptor front end may redetect them.
  const size_t seen = out.size();
  for (const auto& [track, landmark] : map.landmarks()) {
    if (!landmark.p_map || pixels_.contains(track) || landmark.observations.back().keyframe != map.last().id) continue;
    const auto expected = project(T_camera_map * *landmark.p_map, map.lens());
    if (expected && camera_.sees(*expected)) out.push_back({track, expected->cast<float>()});
  }
  std::inplace_merge(out.begin(), out.begin() + static_cast<std::ptrdiff_t>(seen), out.end(),
                     [](const Feature& a, const Feature& b) { return a.track < b.track; });
  return out;
}

void FeatureTracks::save(StateWriter& writer) const {
  front_end_->save(writer);
  SavingArchive{writer}(pixels_);
}

void FeatureTracks::load(StateReader& reader) {
  front_end_->load(reader);
  LoadingArchive{reader}(pixels_);
}

}  // namespace roadfix
