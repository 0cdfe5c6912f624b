/// Keyframes of the local map, their bundle adjustment, and the map's scale. MODEL.md, sections 6 to 9.
///
/// An adjustment started at one frame is applied at the next, on any executor: same images, same bits.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "features/stereo_matcher.h"
#include "slam/distance_prior.h"
#include "slam/initialiser.h"
#include "slam/local_map.h"
#include "slam/tracked_frame.h"
#include "stream/executor.h"

namespace roadfix {

/// What an adjustment has changed.
struct MapAdjustment {
  std::vector<int64_t> outliers;             ///< tracks, ascending, no longer in the map
  Matrix6d cov_keyframe = Matrix6d::Zero();  ///< that a keyframe adds, of the newest one's pose, (S.9.1)
  double scale_drift = 0.0;                  ///< variance of the logarithm of the scale that it adds, (S.10.2)
};

struct NewKeyframe {
  std::vector<std::optional<Eigen::Vector2f>> right;  ///< pixel of each feature in the right image
  int num_landmarks = 0;                              ///< that it observes
};

struct InitialMotion {
  FrameMotion motion;
  Matrix6d cov = Matrix6d::Zero();  ///< as the motion over the last frame: an accelerating car is faster at the end
};

struct ScaleMeasurement {
  std::optional<double> factor;  ///< by which a map without a scale has been scaled about its last keyframe
};

class LocalMapping {
 public:
  /// `matcher`: null without a right camera.
  LocalMapping(const KeyframeTrackerConfig& config, const CameraRig& rig, std::unique_ptr<RightImageMatcher> matcher,
               Executor& executor);
  ~LocalMapping() { executor_.wait(); }
  LocalMapping(const LocalMapping&) = delete;
  LocalMapping& operator=(const LocalMapping&) = delete;

  /// Adds a keyframe and starts an adjustment.
  NewKeyframe add_keyframe(const CameraFrame& frame, const SE3& T_map_camera, std::span<const Feature> features,
                           const std::optional<StandstillSigma>& standstill, const DistancePrior& distance);
  /// Starts a monocular map from two images, and its adjustment. Returns the number of its landmarks.
  int add_two_views(const TwoViewMap& views, const DistancePrior& distance);
  /// From the first keyframe of such a map to the second, once adjusted.
  [[nodiscard]] InitialMotion initial_motion() const;
  /// Waits for the adjustment and applies it; no value where there is none.
  std::optional<MapAdjustment> finish_adjustment();

  /// Measures the scale of a monocular map where speeds are available.
  std::optional<ScaleMeasurement> measure_scale(const DistancePrior& distance);

  /// Removes landmarks (ascending).
  void forget(std::span<const int64_t> tracks) { map_.forget(tracks); }
  void clear() { map_.clear(); }
  /// Transforms the map and its coordinates.
  void move(const SE3& T_new_old);

  [[nodiscard]] const LocalMap& map() const { return map_; }
  /// Time of the image that the map has started with.
  [[nodiscard]] int64_t begun_us() const { return begun_us_; }
  [[nodiscard]] bool stereo() const { return matcher_ != nullptr; }
  [[nodiscard]] bool mono_with_scale() const { return !stereo() && scale_ != ScaleSource::kNone; }
  [[nodiscard]] ScaleSource scale_source() const { return stereo() ? ScaleSource::kStereo : scale_; }
  /// Of errors that all poses share. Monocular rotations: of the estimated focal length, (S.8.2).
  [[nodiscard]] ScaleSigmas scale_sigmas() const;
  /// Of the last keyframe's pose: what this map has added, (S.9.1), and what it has wrong that does not add up, (S.11.1).
  [[nodiscard]] const Matrix6d& cov_own() const { return cov_own_; }
  [[nodiscard]] const Matrix6d& cov_passing() const { return cov_passing_; }

  /// `distance` as it was saved with this.
  void save(StateWriter& writer) const;
  void load(StateReader& reader, const DistancePrior& distance);

 private:
  template <class Mapping, class Archive>
  static void members(Mapping& self, Archive& archive);
  [[nodiscard]] std::vector<std::optional<Eigen::Vector2f>> match_right(const CameraFrame& frame,
                                                                        const SE3& T_map_camera,
                                                                        std::span<const Feature> features);
  /// Returns the number of landmarks among the features.
  int insert(const Keyframe& keyframe, std::span<const KeyframeFeature> features);
  void set_scale(const MeasuredDistance& measured);
  void start_adjustment(const DistancePrior& distance);
  [[nodiscard]] double scale_drift(const BundleJob& job) const;

  CameraRig rig_;
  int bundle_iterations_;
  double drift_;
  Camera left_, right_;
  std::unique_ptr<RightImageMatcher> matcher_;  ///< null without a right camera
  Executor& executor_;
  LocalMap map_;
  std::unique_ptr<BundleJob> job_;
  int64_t begun_us_ = 0;
  Matrix6d cov_own_ = Matrix6d::Zero();
  Matrix6d cov_passing_ = Matrix6d::Zero();
  ScaleSource scale_ = ScaleSource::kNone;  ///< of a monocular map
  double scale_std_ = 0.0;
};

}  // namespace roadfix
