/// Loop closing: places of the trajectory are stored at keyframes, recognised, and used to relocalise after a loss.
/// Holds the covariance of the pose with all loops closed. MODEL.md, section 12.
#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>
#include <span>

#include "features/front_end.h"
#include "samples/samples.h"
#include "slam/accumulated_covariance.h"
#include "slam/local_map.h"
#include "slam/place_graph.h"

namespace roadfix {

class LoopClosing {
 public:
  LoopClosing(const KeyframeTrackerConfig& config, const CameraRig& rig);

  /// Stores the newest keyframe of the map as a place, if it is to be one. True where a loop was closed.
  bool add_keyframe(const cv::Mat& gray, std::span<const Feature> features, const LocalMap& map);
  /// Pose of the camera at a recognised place that the vehicle can have reached since the last pose, T_map_camera,
  /// `unseen_s` ago at `speed`, m/s.
  [[nodiscard]] std::optional<SE3> locate(const cv::Mat& gray, const LocalMap& map, const SE3& T_map_camera,
                                          double speed, double unseen_s) const;
  /// The next map starts at the pose of locate().
  void set_relocalised() { relocalised_ = true; }
  /// A map starts. Whether it is a relocalisation.
  bool begin_map(bool after_loss);
  /// The pose is given from outside. `same_map`: the map continues there.
  void restart(const AccumulatedCovariance& covariance, bool same_map);
  /// Transforms this map's part of the trajectory.
  void move_map(const SE3& T_new_old);
  void level(const LevellingRotation& levelling, const SE3& T_map_keyframe);

  /// From the last keyframe to the next.
  void propagate(const SE3& T_map_keyframe, const SE3& T_keyframe_next);
  /// What the newest keyframe adds, in the map's axes, and the variance of the logarithm of the scale.
  void add(const Matrix6d& keyframe, double scale_drift);

  [[nodiscard]] AccumulatedCovariance& covariance() { return covariance_; }
  [[nodiscard]] const Sim3& S_map_odom() const { return places_.S_map_odom(); }
  /// A pose with all loops closed.
  [[nodiscard]] SE3 closed(const SE3& T_map_camera) const;
  /// The same of the vehicle, whose covariance there is `cov_pose`.
  [[nodiscard]] Odometry closed(Odometry odometry, const Matrix6d& cov_pose) const;
  [[nodiscard]] int num_loops() const { return places_.num_loops(); }

  template <class Self, class Archive>
  static void members(Self& self, Archive& archive) {
    archive(self.places_, self.covariance_, self.step_.pose, self.step_.scale, self.first_place_, self.continuous_,
            self.relocalised_);
  }

 private:
  [[nodiscard]] PlaceView view(const cv::Mat& gray, std::span<const Feature> features, const LocalMap& map,
                               const SE3& T_map_camera) const;

  bool enabled_;
  FrontEndConfig front_end_;
  Camera camera_;
  PlaceGraph places_;
  AccumulatedCovariance covariance_;  ///< of the pose with all loops closed
  StepCovariance step_;               ///< since the last place
  int64_t first_place_ = 0;           ///< of this map
  bool continuous_ = false;           ///< no jump since the last place
  bool relocalised_ = false;          ///< the next map starts at a recognised place
};

}  // namespace roadfix
