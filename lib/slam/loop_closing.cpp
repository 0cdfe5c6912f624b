#include "slam/loop_closing.h"

#include <cmath>
#include <utility>

#include "features/corners.h"
#include "features/keypoints.h"
#include "slam/pose_covariance.h"

namespace roadfix {
namespace {

constexpr int64_t kPlaceEvery = 3;                         ///< keyframes
constexpr int kExtraCorners = 300;                         ///< beside the tracks: another visit may have other tracks
constexpr double kJumpSigma = 10.0, kJumpTurnSigma = 0.3;  // m, rad: where the odometry jumped

/// Reachability of a place `away` metres from the last pose at `speed` within `unseen_s`: similar streets cause false
/// recognitions that are geometrically consistent.
bool within_reach(double away, double speed, double unseen_s, double sigma) {
  constexpr double kAcceleration = 5.0;  // m/s2, above accelerations in traffic
  constexpr double kSigmas = 4.0;
  return away <= speed * unseen_s + 0.5 * kAcceleration * unseen_s * unseen_s + kSigmas * sigma;
}

PlaceGraphConfig graph_config(const KeyframeTrackerConfig& config, const CameraRig& rig) {
  // Corners at integer pixels, from another viewpoint.
  constexpr double kSigma_px = 1.0, kGate_px = 4.0;
  PlaceGraphConfig graph;
  graph.pose.focal_px = Camera(rig.left).focal();
  graph.pose.sigma_px = kSigma_px;
  graph.pose.gate_px = kGate_px;
  graph.with_scale = !rig.right;
  graph.max_places = config.max_places;
  return graph;
}

}  // namespace

LoopClosing::LoopClosing(const KeyframeTrackerConfig& config, const CameraRig& rig)
    : enabled_(config.close_loops),
      front_end_(config.front_end),
      camera_(rig.left),
      places_(graph_config(config, rig)) {}

PlaceView LoopClosing::view(const cv::Mat& gray, std::span<const Feature> features, const LocalMap& map,
                            const SE3& T_map_camera) const {
  std::vector<Eigen::Vector2f> pixels;
  for (const Feature& f : features) pixels.push_back(f.pixel);
  CornerConfig corners;
  corners.max_corners = kExtraCorners;
  corners.min_distance_px = 0.5 * front_end_.min_distance_px;
  corners.fast_threshold = front_end_.fast_threshold;
  for (const Corner& corner : spread_corners(gray, pixels, corners)) pixels.push_back(corner.pixel);
  DescribedCorners described = describe_corners(gray, pixels);
  PlaceView view;
  view.T_odom_camera = T_map_camera;
  view.cov = covariance_.with_considered();
  view.step = step_;
  const SE3 T_camera_map = T_map_camera.inverse();
  for (size_t row = 0; row < described.index.size(); ++row) {
    const size_t i = described.index[row];
    const auto normalised = camera_.unproject(pixels[i].cast<double>());
    if (!normalised) continue;
    view.normalised.push_back(map.lens().remove(*normalised));
    view.descriptors.push_back(described.descriptors.row(static_cast<int>(row)));
    const Landmark* landmark = i < features.size() ? map.find(features[i].track) : nullptr;
    view.p_camera.emplace_back();
    if (landmark != nullptr && landmark->p_map) view.p_camera.back() = T_camera_map * *landmark->p_map;
  }
  return view;
}

bool LoopClosing::add_keyframe(const cv::Mat& gray, std::span<const Feature> features, const LocalMap& map) {
  if (!enabled_) return false;
  const Keyframe& keyframe = map.last();
  const bool jumped = !std::exchange(continuous_, true);
  if (jumped) {
    step_.pose.diagonal() << Eigen::Vector3d::Constant(kJumpSigma * kJumpSigma),
        Eigen::Vector3d::Constant(kJumpTurnSigma * kJumpTurnSigma);
  }
  const bool store = jumped || keyframe.id % kPlaceEvery == 0;
  const bool closed_loop = places_.add_view(view(gray, features, map, keyframe.T_map_camera), store);
  if (store) step_ = {};
  // Includes the error shared with the place.
  if (closed_loop) covariance_.start_at(closed(keyframe.T_map_camera), places_.cov_after_loop());
  return closed_loop;
}

std::optional<SE3> LoopClosing::locate(const cv::Mat& gray, const LocalMap& map, const SE3& T_map_camera, double speed,
                                       double unseen_s) const {
  if (!enabled_ || places_.num_places() == 0) return std::nullopt;
  auto found = places_.locate(view(gray, {}, map, T_map_camera));
  const double sigma = std::sqrt(covariance_.keyframe().topLeftCorner<3, 3>().trace());
  if (!found || !within_reach((found->p - T_map_camera.p).norm(), speed, unseen_s, sigma)) return std::nullopt;
  return found;
}

bool LoopClosing::begin_map(bool after_loss) {
  if (after_loss) continuous_ = relocalised_;
  first_place_ = places_.next_place();
  return std::exchange(relocalised_, false);
}

void LoopClosing::restart(const AccumulatedCovariance& covariance, bool same_map) {
  relocalised_ = false;
  if (!same_map) continuous_ = false;
  covariance_ = covariance;
}

void LoopClosing::propagate(const SE3& T_map_keyframe, const SE3& T_keyframe_next) {
  covariance_.propagate(S_map_odom().rigid() * T_map_keyframe, T_keyframe_next);
  step_.pose = transported(step_.pose, T_map_keyframe, T_keyframe_next);
}

void LoopClosing::add(const Matrix6d& keyframe, double scale_drift) {
  covariance_.add(rotated(keyframe, S_map_odom()), scale_drift);
  step_.pose += keyframe;
  step_.scale += scale_drift;
}

void LoopClosing::move_map(const SE3& T_new_old) {
  places_.move(first_place_, T_new_old);
  step_.pose = rotated(step_.pose, {T_new_old.q, Eigen::Vector3d::Zero(), 1.0});
}

void LoopClosing::level(const LevellingRotation& levelling, const SE3& T_map_keyframe) {
  places_.rotate(levelling);
  step_.pose = rotated(step_.pose, {levelling.transform().q, Eigen::Vector3d::Zero(), 1.0});
  covariance_.level(levelling, S_map_odom().rigid() * T_map_keyframe);
}

SE3 LoopClosing::closed(const SE3& T_map_camera) const {
  return (S_map_odom() * Sim3{T_map_camera.q, T_map_camera.p, 1.0}).rigid();
}

Odometry LoopClosing::closed(Odometry odometry, const Matrix6d& cov_pose) const {
  const Sim3& S = S_map_odom();
  SE3& T = odometry.T_frame_vehicle;
  T = {(S.q * T.q).normalized(), S.scale * (S.q * T.p) + S.p};
  odometry.velocity *= S.scale;
  odometry.cov_pose = cov_pose;
  return odometry;
}

}  // namespace roadfix
