/// Predicted position of each track in the next image.
#include <algorithm>
#include <limits>

#include "slam/keyframe_tracker.h"
#include "slam/reprojection.h"

namespace roadfix {
namespace {

/// A track without a point is predicted with the depth of the nearest track with one, else at infinity.
double inverse_depth_near(const Eigen::Vector2f& pixel, const auto& known) {
  double inverse_depth = 0.0;
  float nearest = std::numeric_limits<float>::infinity();
  for (const auto& k : known) {
    const float distance = (k.pixel - pixel).squaredNorm();
    if (distance >= nearest) continue;
    nearest = distance;
    inverse_depth = k.inverse_depth;
  }
  return inverse_depth;
}

}  // namespace

std::optional<Eigen::Vector2d> KeyframeTracker::project_pixel(const Eigen::Vector3d& p_camera) const {
  if (!(p_camera.z() > kMinReprojectionDepth)) return std::nullopt;
  return left_.distort(map_.lens().apply(p_camera.hnormalized()));
}

/// Pixels and inverse depths of the points in the last image.
std::vector<KeyframeTracker::KnownDepth> KeyframeTracker::known_depths() const {
  std::vector<KnownDepth> known;
  const SE3 T_camera_map = T_map_camera_.inverse();
  for (const auto& [track, pixel] : pixels_) {
    const Landmark* landmark = map_.find(track);
    if (landmark == nullptr || !landmark->p_map) continue;
    const double depth = (T_camera_map * *landmark->p_map).z();
    if (depth > kMinReprojectionDepth) known.push_back({pixel, 1.0 / depth});
  }
  return known;
}

std::vector<Feature> KeyframeTracker::predicted_features(const SE3& T_map_camera) const {
  std::vector<Feature> out;
  const SE3 T_camera_map = T_map_camera.inverse();
  const SE3 T_now_before = T_camera_map * T_map_camera_;
  const std::vector<KnownDepth> known = known_depths();
  for (const auto& [track, pixel] : pixels_) {
    const Landmark* landmark = map_.find(track);
    std::optional<Eigen::Vector2d> expected;
    if (landmark != nullptr && landmark->p_map) {
      expected = project_pixel(T_camera_map * *landmark->p_map);
    } else if (const auto before = left_.unproject(pixel.cast<double>())) {
      const Eigen::Vector3d direction = map_.lens().remove(*before).homogeneous();
      expected = project_pixel(T_now_before.q * direction + inverse_depth_near(pixel, known) * T_now_before.p);
    }
    if (expected) out.push_back({track, expected->cast<float>()});
  }
  // Landmarks not detected in the last images: a descriptor front end may redetect them.
  const size_t seen = out.size();
  for (const auto& [track, landmark] : map_.landmarks()) {
    if (!landmark.p_map || pixels_.contains(track) || landmark.observations.back().keyframe != map_.last().id) continue;
    const auto expected = project_pixel(T_camera_map * *landmark.p_map);
    if (expected && left_.sees(*expected)) out.push_back({track, expected->cast<float>()});
  }
  std::inplace_merge(out.begin(), out.begin() + static_cast<std::ptrdiff_t>(seen), out.end(),
                     [](const Feature& a, const Feature& b) { return a.track < b.track; });
  return out;
}

}  // namespace roadfix
