/// The last keyframes, the landmarks they see, and what keeps them consistent. A landmark has the number of its track.
#pragma once

#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "slam/bundle.h"
#include "slam/config.h"
#include "slam/travel.h"

namespace roadfix {

/// One landmark in one keyframe, normalised coordinates.
struct Sighting {
  int64_t keyframe = 0;
  Eigen::Vector2d left;
  std::optional<Eigen::Vector2d> right;

  template <class Self, class Archive>
  static void members(Self& self, Archive& archive) {
    archive(self.keyframe, self.left, self.right);
  }
};

struct Landmark {
  std::optional<Eigen::Vector3d> p_map;  ///< m, once two rays have made it a point
  std::vector<Sighting> sightings;       ///< in ascending order of keyframe

  template <class Self, class Archive>
  static void members(Self& self, Archive& archive) {
    archive(self.p_map, self.sightings);
  }
};

struct Keyframe {
  int64_t id = 0;
  int64_t t_us = 0;
  SE3 T_map_camera;                     ///< of the left eye
  std::optional<double> held_distance;  ///< to the keyframe before: a unit of length, where nothing else gives one
  LensPull pull = LensPull::Zero();     ///< against the keyframes that were held when it was last adjusted
  std::optional<StandingDoubt> stood;   ///< since the keyframe before

  template <class Self, class Archive>
  static void members(Self& self, Archive& archive) {
    archive(self.id, self.t_us, self.T_map_camera, self.held_distance, self.pull, self.stood);
  }
};

/// What a keyframe sees of one track.
struct KeyframeFeature {
  int64_t track = 0;
  Eigen::Vector2d left;
  std::optional<Eigen::Vector2d> right;
};

/// A bundle adjustment taken out of the map, so that it can be solved beside the tracking.
struct BundleJob {
  BundleProblem problem;
  std::vector<int64_t> keyframes;  ///< one per view
  std::vector<int64_t> tracks;     ///< one per point
  BundleReport report;
};

class LocalMap {
 public:
  LocalMap(const CameraRig& rig, const KeyframeTrackerConfig& config);

  /// Adds a keyframe, makes points of the landmarks that have enough parallax by now, and forgets the keyframes that
  /// left the window. Returns its id.
  int64_t add_keyframe(const Keyframe& keyframe, std::span<const KeyframeFeature> features);

  /// Way of the camera between two keyframes, m, where something other than the pictures says so.
  using TravelBetween = std::function<std::optional<Travel>(const Keyframe&, const Keyframe&)>;
  [[nodiscard]] BundleJob make_bundle(const TravelBetween& travel) const;
  /// Takes the result in; returns the tracks that turned out wrong, ascending, which the map has forgotten.
  std::vector<int64_t> apply(const BundleJob& job);

  /// All lengths times `factor`, the camera of the last keyframe staying where it is.
  void rescale(double factor);
  /// All of it, coordinates included.
  void move(const SE3& T);

  void save(StateWriter& writer) const;
  void load(StateReader& reader);

  /// Forgets landmarks (ascending).
  void forget(std::span<const int64_t> tracks);
  void clear();

  [[nodiscard]] bool empty() const { return keyframes_.empty(); }
  [[nodiscard]] const std::deque<Keyframe>& keyframes() const { return keyframes_; }
  [[nodiscard]] const Keyframe& last() const { return keyframes_.back(); }
  /// Of the newest keyframe that bundle adjustment holds.
  [[nodiscard]] int64_t held_us() const { return keyframes_[num_fixed() - 1].t_us; }
  [[nodiscard]] const std::map<int64_t, Landmark>& landmarks() const { return landmarks_; }
  [[nodiscard]] const Landmark* find(int64_t track) const;
  [[nodiscard]] const LensCorrection& lens() const { return lens_; }
  /// Relative, of the focal length that is learnt, (M.15).
  [[nodiscard]] double focal_std() const;
  [[nodiscard]] int64_t num_keyframes_ever() const { return next_id_; }
  /// A rig of two eyes of which the right one has not been there for the last keyframes: a camera like mono's.
  [[nodiscard]] bool one_eyed() const { return one_eyed_; }

 private:
  template <class Map, class Archive>
  static void members(Map& self, Archive& archive);
  void make_points();
  void count_eyes(std::span<const KeyframeFeature> features);
  void learn_lens(const BundleJob& job);
  void free_lens(BundleProblem& problem, size_t fixed) const;
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
  LensCorrection lens_prior_;  ///< its mean before the next adjustment
  LensCorrection::Matrix lens_information_;
  int64_t without_right_ = 0;  ///< keyframes in a row
  bool one_eyed_ = false;
};

}  // namespace roadfix
