/// The local map: last keyframes, their landmarks, and the constraints between them. A landmark has the number of its
/// track.
#pragma once

#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "slam/bundle.h"
#include "slam/config.h"
#include "slam/distance_history.h"

namespace roadfix {

/// Observation of a landmark in one keyframe, normalised coordinates.
struct LandmarkObservation {
  int64_t keyframe = 0;
  Eigen::Vector2d left;
  std::optional<Eigen::Vector2d> right;

  template <class Self, class Archive>
  static void members(Self& self, Archive& archive) {
    archive(self.keyframe, self.left, self.right);
  }
};

struct Landmark {
  std::optional<Eigen::Vector3d> p_map;           ///< m, once triangulated
  std::vector<LandmarkObservation> observations;  ///< in ascending order of keyframe

  template <class Self, class Archive>
  static void members(Self& self, Archive& archive) {
    archive(self.p_map, self.observations);
  }
};

struct Keyframe {
  int64_t id = 0;
  int64_t t_us = 0;
  SE3 T_map_camera;                          ///< of the left camera
  std::optional<double> reference_distance;  ///< to the previous keyframe: the unit of length, without a measured one
  LensSensitivity lens_sensitivity = LensSensitivity::Zero();  ///< relative to the fixed keyframes of its last
                                                               ///< adjustment
  std::optional<StandstillSigma> standstill;                   ///< since the previous keyframe

  template <class Self, class Archive>
  static void members(Self& self, Archive& archive) {
    archive(self.id, self.t_us, self.T_map_camera, self.reference_distance, self.lens_sensitivity, self.standstill);
  }
};

/// Observation of one track in a keyframe.
struct KeyframeFeature {
  int64_t track = 0;
  Eigen::Vector2d left;
  std::optional<Eigen::Vector2d> right;
};

/// A bundle adjustment problem copied from the map, to be solved in parallel with the tracking.
struct BundleJob {
  BundleProblem problem;
  std::vector<int64_t> keyframes;  ///< one per view
  std::vector<int64_t> tracks;     ///< one per point
  BundleReport report;
};

class LocalMap {
 public:
  LocalMap(const CameraRig& rig, const KeyframeTrackerConfig& config);

  /// Adds a keyframe, triangulates landmarks with sufficient parallax and removes keyframes that left the window.
  /// Returns its id.
  int64_t add_keyframe(const Keyframe& keyframe, std::span<const KeyframeFeature> features);

  /// Distance of the camera between two keyframes, m, from other sensors.
  using DistanceBetween = std::function<std::optional<TravelledDistance>(const Keyframe&, const Keyframe&)>;
  [[nodiscard]] BundleJob make_bundle(const DistanceBetween& travel) const;
  /// Applies the result; returns the outlier tracks, ascending, which are removed from the map.
  std::vector<int64_t> apply(const BundleJob& job);

  /// Scales all lengths by `factor` about the last keyframe's camera.
  void rescale(double factor);
  /// Transforms the map and its coordinates.
  void move(const SE3& T);

  void save(StateWriter& writer) const;
  void load(StateReader& reader);

  /// Removes landmarks (ascending).
  void forget(std::span<const int64_t> tracks);
  void clear();

  [[nodiscard]] bool empty() const { return keyframes_.empty(); }
  [[nodiscard]] const std::deque<Keyframe>& keyframes() const { return keyframes_; }
  [[nodiscard]] const Keyframe& last() const { return keyframes_.back(); }
  /// Time of the newest fixed keyframe.
  [[nodiscard]] int64_t last_fixed_us() const { return keyframes_[num_fixed() - 1].t_us; }
  [[nodiscard]] const std::map<int64_t, Landmark>& landmarks() const { return landmarks_; }
  [[nodiscard]] const Landmark* find(int64_t track) const;
  [[nodiscard]] const LensCorrection& lens() const { return lens_; }
  /// Relative, of the estimated focal length, (S.8.1).
  [[nodiscard]] double focal_std() const;
  [[nodiscard]] int64_t num_keyframes_ever() const { return next_id_; }
  /// A stereo rig whose right image has been missing for the last keyframes: treated as monocular.
  [[nodiscard]] bool right_camera_lost() const { return right_camera_lost_; }

 private:
  template <class Map, class Archive>
  static void members(Map& self, Archive& archive);
  void make_points();
  void update_right_camera(std::span<const KeyframeFeature> features);
  void update_lens(const BundleJob& job);
  void link_fixed_views_to_lens(BundleProblem& problem, size_t fixed) const;
  void forget_old_keyframes();
  [[nodiscard]] const Keyframe* keyframe(int64_t id) const;
  [[nodiscard]] std::optional<Eigen::Vector3d> locate(const Landmark& landmark) const;
  [[nodiscard]] double worst_error_px(const Landmark& landmark, const Eigen::Vector3d& p_map) const;
  [[nodiscard]] size_t num_fixed() const;

  CameraRig rig_;
  KeyframeTrackerConfig config_;
  double focal_px_;
  std::deque<Keyframe> keyframes_;
  std::map<int64_t, Landmark> landmarks_;
  int64_t next_id_ = 0;
  LensCorrection lens_;
  LensCorrection lens_prior_;  ///< mean before the next adjustment
  LensCorrection::Matrix lens_information_;
  int64_t keyframes_without_right_ = 0;  ///< consecutive
  bool right_camera_lost_ = false;
};

}  // namespace roadfix
