/// One frame of the keyframe tracker: its images and what the tracker makes of them.
#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "features/front_end.h"
#include "samples/samples.h"
#include "slam/config.h"
#include "slam/considered_errors.h"

namespace roadfix {

struct CameraFrame {
  int64_t t_us = 0;
  cv::Mat left;   ///< 8-bit grey
  cv::Mat right;  ///< empty: monocular
};

enum class TrackState { kInitialising, kGood, kWeak, kLost, kRelocalised };
enum class ScaleSource { kNone, kStereo, kWheels, kIns };
enum class FeatureStatus : int8_t { kNew, kMatched, kInlier, kOutlier };

struct TrackedFeature {
  Feature feature;
  FeatureStatus status = FeatureStatus::kNew;
  std::optional<Eigen::Vector2f> right = {};  ///< pixel in the right image, of a keyframe
};

/// Result of one frame.
struct TrackedFrame {
  Odometry odometry;  ///< frame local; invalid unless the state is good, weak or relocalised
  TrackState state = TrackState::kInitialising;
  bool map_started = false;  ///< at this frame
  std::string reason;        ///< text for the operator, empty when good
  ScaleSource scale = ScaleSource::kNone;
  double scale_std = 0.0;  ///< relative, common to the whole trajectory; undefined where the source is none
  /// Error of the pose per sigma of what the trajectory shares; its square is contained in the covariances.
  ConsideredColumns considered = ConsideredColumns::Zero();
  /// Errors that do not accumulate (S.11.1), in the order and axes of cov_pose, which contains them.
  Matrix6d cov_image = Matrix6d::Zero();   ///< of this image alone
  Matrix6d cov_map = Matrix6d::Zero();     ///< of the local map that the image is matched to,
  double map_time = 0.0;                   ///< s, duration of that map
  int reset_counter = 0;                   ///< +1 per jump of the pose
  SE3 reset_delta;                         ///< of the last jump: p is new minus old, q is q_old^-1 q_new
  Matrix6d cov_closed = Matrix6d::Zero();  ///< of the pose with all loops closed
  int closed_reset_counter = 0;            ///< for the pose with all loops closed, which jumps at a loop closure
  SE3 closed_reset_delta;
  int num_loops = 0;
  std::vector<TrackedFeature> features;
  int num_expected = 0;        ///< tracks searched
  int num_matches = 0;         ///< tracks found
  int num_landmarks_seen = 0;  ///< of these, with known points
  int num_inliers = 0;         ///< of these, consistent with the pose
  double rms_px = 0.0;
  double brightness = 0.0;  ///< mean grey level
  int64_t num_keyframes = 0;
  int64_t num_landmarks = 0;

  /// The frame after this one, with its counters of jumps.
  [[nodiscard]] TrackedFrame next(int64_t t_us) const;
  /// Counts a jump of the pose, which the one with all loops closed makes as well.
  void count_reset(const SE3& delta);

  /// What later frames depend on.
  template <class Self, class Archive>
  static void members(Self& self, Archive& archive) {
    auto& o = self.odometry;
    archive(o.t_us, o.T_frame_vehicle, o.velocity, o.angular_rate, o.cov_pose, o.cov_velocity, o.validity);
    archive(self.state, self.reason, self.reset_counter, self.reset_delta, self.cov_closed, self.closed_reset_counter,
            self.closed_reset_delta, self.considered, self.cov_image, self.cov_map, self.map_time);
  }
};

/// Whether images can be tracked.
struct ImageCheck {
  std::string rejection;    ///< text for the operator; empty: they can
  double brightness = 0.0;  ///< mean grey level of the left image
};
/// `min_contrast`: standard deviation of grey levels.
ImageCheck check_images(const CameraFrame& frame, const CameraRig& rig, double min_contrast);

/// Tracks of the outliers, in the order of the features.
std::vector<int64_t> outlier_tracks(const TrackedFrame& frame);

/// Records the pixels of these features in the right image, where the frame has them; both in ascending order of track.
void set_right_pixels(const std::vector<Feature>& features, const std::vector<std::optional<Eigen::Vector2f>>& right,
                      TrackedFrame& frame);

/// Change of a pose in a jump, in the form of TrackedFrame's reset deltas.
SE3 pose_change(const SE3& T_old, const SE3& T_new);

}  // namespace roadfix
