#include "slam/pose_tracking.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "geometry/frames.h"
#include "geometry/so3.h"
#include "slam/bearing_only_pose.h"
#include "slam/pose_covariance.h"
#include "slam/track_shifts.h"
#include "slam/triangulation.h"
#include "statistics/upper_median.h"

namespace roadfix {
namespace {

constexpr double kNoiseFlow = 1.67;    ///< sigmas: Rayleigh median times root 2, of flow that is noise only
constexpr double kMedianNoise = 1.77;  ///< of the median of n shifts between two observations, times sigma / sqrt(n)
constexpr double kMaxBearingOnlyDistance = 2.0;  ///< m: a fifth of the depth assumed in (S.5.2)
constexpr double kStandingDepth = 10.0;          ///< m, assumed depth: possible motion for a given flow

/// Median of each coordinate.
Eigen::Vector2d median_of(std::span<const Eigen::Vector2d> shifts) {
  std::vector<double> x, y;
  for (const Eigen::Vector2d& shift : shifts) {
    x.push_back(shift.x());
    y.push_back(shift.y());
  }
  return {upper_median(std::move(x)), upper_median(std::move(y))};
}

/// Tracks in the last keyframe and in this image, true directions.
struct CommonTracks {
  std::vector<size_t> feature;
  std::vector<Eigen::Vector2d> first, second;
};

CommonTracks common_tracks(const LocalMap& map, const Camera& camera, std::span<const Feature> features) {
  CommonTracks common;
  for (size_t i = 0; i < features.size(); ++i) {
    const Landmark* landmark = map.find(features[i].track);
    const auto now = camera.unproject(features[i].pixel.cast<double>());
    if (landmark == nullptr || landmark->observations.empty() || !now) continue;
    const LandmarkObservation& seen = landmark->observations.back();
    if (seen.keyframe != map.last().id) continue;
    common.feature.push_back(i);
    common.first.push_back(map.lens().remove(seen.left));
    common.second.push_back(map.lens().remove(*now));
  }
  return common;
}

}  // namespace

ObservedLandmarks PoseTracking::observe(const LocalMap& map, std::span<const Feature> features) const {
  ObservedLandmarks seen;
  for (size_t i = 0; i < features.size(); ++i) {
    const Landmark* landmark = map.find(features[i].track);
    const auto normalised = camera_.unproject(features[i].pixel.cast<double>());
    if (landmark == nullptr || !landmark->p_map || !normalised) continue;
    seen.points.push_back({*landmark->p_map, *normalised});
    seen.feature.push_back(i);
  }
  return seen;
}

std::optional<TrackedPose> PoseTracking::from_landmarks(const LocalMap& map, const ObservedLandmarks& seen,
                                                        size_t num_features, const SE3& T_predicted,
                                                        double max_turn_error) const {
  const std::vector<PosePoint>& points = seen.points;
  const PoseSolverConfig config{camera_.focal(), config_.sigma_px, config_.gate_px, config_.min_inliers, map.lens()};
  auto solution = solve_pose(points, T_predicted, config);
  if (!solution || 2 * solution->num_inliers < static_cast<int>(points.size())) {
    auto found = search_pose(points, config);
    if (found && (!solution || found->num_inliers > solution->num_inliers)) solution = std::move(found);
  }
  // A few wrong landmarks can agree on an impossible rotation.
  if (!solution || !(log_q(T_predicted.q.conjugate() * solution->T_map_camera.q).norm() < max_turn_error)) {
    return std::nullopt;
  }
  TrackedPose pose{solution->T_map_camera, solution->cov};
  pose.status.resize(num_features, FeatureStatus::kMatched);
  for (size_t k = 0; k < seen.feature.size(); ++k) {
    pose.status[seen.feature[k]] = solution->inlier[k] ? FeatureStatus::kInlier : FeatureStatus::kOutlier;
  }
  pose.num_inliers = solution->num_inliers;
  pose.rms_px = solution->rms_px;
  const bool weak = solution->num_inliers < config_.weak_inliers ||
                    solution->num_inliers < config_.weak_ratio * static_cast<double>(points.size());
  if (weak) {
    pose.state = TrackState::kWeak;
    pose.reason = "few landmarks agree with the pose";
  }
  return pose;
}

/// At a standstill a monocular map gains no points, and passing vehicles end the existing ones. Static tracks still
/// determine the pose.
std::optional<TrackedPose> PoseTracking::at_standstill(const LocalMap& map, std::span<const Feature> features) const {
  const std::vector<Eigen::Vector2d> shifts = track_shifts(map, camera_, Eigen::Quaterniond::Identity(), features);
  if (static_cast<int>(shifts.size()) < config_.weak_inliers) return std::nullopt;
  const bool known = config_.standing_flow_px > 0.0;
  const double still_px = known ? std::hypot(config_.standing_flow_px, kNoiseFlow * config_.sigma_px) : 0.0;
  if (upper_median(lengths_of(shifts)) >= still_px) return std::nullopt;
  // A rotation moves all tracks alike; a translation does not.
  const double noise_px = kMedianNoise * config_.sigma_px / std::sqrt(static_cast<double>(shifts.size()));
  const double turn = std::hypot(median_of(shifts).norm(), noise_px) / camera_.focal();
  const double displacement = kStandingDepth * still_px / camera_.focal();
  Vector6d variances;
  variances << Eigen::Vector3d::Constant(displacement * displacement), Eigen::Vector3d::Constant(turn * turn);
  TrackedPose pose{map.last().T_map_camera, variances.asDiagonal(), TrackState::kWeak, "standing, with few landmarks"};
  pose.status.resize(features.size(), FeatureStatus::kMatched);
  pose.from_landmarks = false;
  pose.needs_keyframe = static_cast<int>(shifts.size()) < 2 * config_.weak_inliers;
  pose.standstill = StandstillSigma{displacement, turn};
  return pose;
}

/// Tracks have no points yet: they determine the rotation, speeds the distance, and the vehicle's forward axis the
/// direction, until the tracks have the parallax for points. (S.5.2), (S.5.3).
std::optional<TrackedPose> PoseTracking::at_pull_away(const LocalMap& map, std::span<const Feature> features,
                                                      int64_t t_us, const SE3& T_predicted,
                                                      const DistancePrior& distance) const {
  const Keyframe& from = map.last();
  const auto measured = distance.of_vehicle(from.t_us, t_us);
  if (!measured || measured->travelled.distance > kMaxBearingOnlyDistance) return std::nullopt;
  const auto [index, first, second] = common_tracks(map, camera_, features);
  const double forward = measured->travelled.backwards ? -1.0 : 1.0;
  const Eigen::Vector3d ahead = q_camera_vehicle_ * (forward * Eigen::Vector3d::UnitX());
  const BearingOnlyConfig config{camera_.focal(), config_.sigma_px, config_.gate_px, config_.weak_inliers, ahead};
  const double length_sigma = std::max(kMinDistanceSigma, measured->travelled.sigma);
  const Eigen::Quaterniond q_start = from.T_map_camera.q.conjugate() * T_predicted.q;
  auto motion = bearing_only_pose(first, second, measured->travelled.distance, length_sigma, q_start, config);
  if (!motion) return std::nullopt;
  const auto of_camera = distance.of_camera(from.t_us, SE3{}, t_us, motion->T_first_second);
  if (of_camera) motion->T_first_second.p = of_camera->travelled.distance * ahead;
  TrackedPose pose{from.T_map_camera * motion->T_first_second,
                   rotated(motion->cov_pose(length_sigma), {from.T_map_camera.q, {}, 1.0}), TrackState::kWeak,
                   "pulling away, with few landmarks"};
  pose.status.resize(features.size(), FeatureStatus::kMatched);
  pose.from_landmarks = false;
  int points = 0;
  for (size_t k = 0; k < index.size(); ++k) {
    if (!motion->inlier[k]) pose.status[index[k]] = FeatureStatus::kOutlier;
    const std::array<Ray, 2> rays{ray(SE3{}, first[k]), ray(motion->T_first_second, second[k])};
    points += motion->inlier[k] && triangulate(rays, config_.min_parallax_deg * kDegree) ? 1 : 0;
  }
  pose.needs_keyframe = points >= std::min(config_.start_points, static_cast<int>(index.size()) / 2);
  return pose;
}

}  // namespace roadfix
