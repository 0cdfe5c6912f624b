/// Start of a monocular map from two images with sufficient parallax, and the state while there is no map. MODEL.md,
/// section 6.
#pragma once

#include <map>
#include <optional>
#include <span>
#include <vector>

#include "slam/camera_state.h"
#include "slam/feature_tracks.h"
#include "slam/local_map.h"
#include "slam/motion_prior.h"
#include "slam/tracked_frame.h"

namespace roadfix {

/// A map of two keyframes.
struct TwoViewMap {
  Keyframe first, second;
  std::vector<KeyframeFeature> first_features, second_features;
  std::optional<MeasuredDistance> measured;  ///< length of the baseline; else its unit is arbitrary
};

/// Outcome of an image.
struct InitialisationStep {
  std::optional<TwoViewMap> map;  ///< from the first image and this one
  bool standing = false;          ///< the camera has not moved since the first image
  bool is_first = false;          ///< this is the first image
};

/// The first of the two.
struct FirstImage {
  int64_t t_us = 0;
  std::map<int64_t, Eigen::Vector2d> seen;  ///< normalised, by track

  template <class Self, class Archive>
  static void members(Self& self, Archive& archive) {
    archive(self.t_us, self.seen);
  }
};

class Initialiser {
 public:
  Initialiser(const KeyframeTrackerConfig& config, const Camera& camera, const Eigen::Quaterniond& q_camera_vehicle)
      : config_(config), camera_(camera), q_camera_vehicle_(q_camera_vehicle) {}

  /// The next image without a map; T_map_camera was the same at the first one.
  InitialisationStep track(const CameraFrame& frame, const CameraState& camera, const MotionPrior& prior,
                           FeatureTracks& tracks, TrackedFrame& out);

  /// State without a map: initialising while waiting for motion; else lost, also before the first map, so that another
  /// source provides the pose. `usable`: this image can start or continue an initialisation; `had_pose`: before.
  [[nodiscard]] TrackState state_without_map(int64_t t_us, bool usable, bool had_pose);
  /// A map has started, or a pose is given from outside.
  void forget_usable() { usable_us_.reset(); }
  void reset() { first_.reset(); }
  /// Time of the first image, if any.
  [[nodiscard]] std::optional<int64_t> begun_us() const { return first_ ? std::optional(first_->t_us) : std::nullopt; }

  template <class Self, class Archive>
  static void members(Self& self, Archive& archive) {
    archive(self.first_, self.usable_us_);
  }

 private:
  /// Tracks in the first image and in this one, in ascending order of track.
  struct CommonTracks {
    std::vector<Feature> now;
    std::vector<Eigen::Vector2d> first, second;  ///< normalised
    std::vector<double> flow_px;                 ///< from the first to the second
    std::vector<bool> inlier = {};
  };

  void begin(int64_t t_us, std::vector<Feature> features, FeatureTracks& tracks, TrackedFrame& out);
  void wait_for_parallax(int64_t t_us, size_t points, bool had_pose, TrackedFrame& out);
  [[nodiscard]] CommonTracks common_tracks(std::span<const Feature> features) const;
  [[nodiscard]] bool enough_parallax(const CommonTracks& common) const;
  [[nodiscard]] std::optional<TwoViewMap> solve(CommonTracks& common, int64_t t_us, const SE3& T_map_first,
                                                const MotionPrior& prior) const;
  void take_tracks(const CommonTracks& common, TwoViewMap& map, FeatureTracks& tracks, TrackedFrame& out) const;

  KeyframeTrackerConfig config_;
  Camera camera_;
  Eigen::Quaterniond q_camera_vehicle_;
  std::optional<FirstImage> first_;
  std::optional<int64_t> usable_us_;  ///< of the last usable image, or of the first attempt
};

}  // namespace roadfix
