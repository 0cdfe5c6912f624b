/// Pose of one image from its tracks: from the landmarks, MODEL.md, section 4, or, at a standstill and right after it,
/// from tracks without points, section 5. Without state.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "slam/distance_prior.h"
#include "slam/local_map.h"
#include "slam/pose_solver.h"
#include "slam/tracked_frame.h"

namespace roadfix {

/// Landmarks of the map that an image shows.
struct ObservedLandmarks {
  std::vector<PosePoint> points;
  std::vector<size_t> feature;  ///< of each point: index of its feature
};

struct TrackedPose {
  SE3 T_map_camera;
  Matrix6d cov = Matrix6d::Zero();  ///< of this image alone
  TrackState state = TrackState::kGood;
  std::string reason = {};                 ///< text for the operator
  std::vector<FeatureStatus> status = {};  ///< one per feature
  int num_inliers = 0;                     ///< landmarks that agree
  double rms_px = 0.0;
  bool from_landmarks = true;
  bool needs_keyframe = false;  ///< where it is not from landmarks
  std::optional<StandstillSigma> standstill = {};
};

class PoseTracking {
 public:
  PoseTracking(const KeyframeTrackerConfig& config, const Camera& camera, const Eigen::Quaterniond& q_camera_vehicle)
      : config_(config), camera_(camera), q_camera_vehicle_(q_camera_vehicle) {}

  [[nodiscard]] ObservedLandmarks observe(const LocalMap& map, std::span<const Feature> features) const;

  /// `max_turn_error`: of the prediction, rad. No value where too few landmarks agree, or on an implausible turn.
  [[nodiscard]] std::optional<TrackedPose> from_landmarks(const LocalMap& map, const ObservedLandmarks& seen,
                                                          size_t num_features, const SE3& T_predicted,
                                                          double max_turn_error) const;

  /// The last keyframe's pose, where the tracks are where it has observed them.
  [[nodiscard]] std::optional<TrackedPose> at_standstill(const LocalMap& map, std::span<const Feature> features) const;

  /// At a pull-away: the turn from the tracks, the distance from speeds. A map of known scale.
  [[nodiscard]] std::optional<TrackedPose> at_pull_away(const LocalMap& map, std::span<const Feature> features,
                                                        int64_t t_us, const SE3& T_predicted,
                                                        const DistancePrior& distance) const;

 private:
  KeyframeTrackerConfig config_;
  Camera camera_;
  Eigen::Quaterniond q_camera_vehicle_;
};

}  // namespace roadfix
