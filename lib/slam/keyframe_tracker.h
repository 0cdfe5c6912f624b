/// Keyframe-based visual odometry, monocular or stereo. Derivation: lib/slam/MODEL.md, cited in lib/slam as (S.n.m).
///
/// From image to pose as in ORB-SLAM (Mur-Artal, Montiel, Tardos 2015): tracking (feature_tracks.h, pose_tracking.h),
/// local mapping (keyframe_criterion.h, local_mapping.h), loop closing (loop_closing.h); the start of a map is
/// initialiser.h, and what other sensors know of the motion motion_prior.h. This class calls them in that order.
///
/// Frames: local, also called map, has the vehicle's axes at the first pose until it is levelled by an INS; camera: the
/// left one. Monocular lengths are in an arbitrary unit until a scale is measured. Same images, same bits.
#pragma once

#include <memory>
#include <string>

#include "slam/config.h"
#include "slam/feature_tracks.h"
#include "slam/initialiser.h"
#include "slam/keyframe_criterion.h"
#include "slam/local_mapping.h"
#include "slam/loop_closing.h"
#include "slam/motion_prior.h"
#include "slam/pose_tracking.h"
#include "slam/restart.h"
#include "slam/tracked_frame.h"
#include "slam/vehicle_odometry.h"
#include "stream/digest.h"
#include "stream/executor.h"

namespace roadfix {

class KeyframeTracker {
 public:
  /// `right_matcher`: for simulated tracks; by default images are matched.
  KeyframeTracker(const KeyframeTrackerConfig& config, const CameraRig& rig, std::unique_ptr<FrontEnd> front_end,
                  Executor& executor, std::unique_ptr<RightImageMatcher> right_matcher = nullptr);

  /// Vehicle speed from wheels or an INS: the source of the monocular scale. Used from the next frame on, also for past
  /// distances: speeds may be older than the last frame.
  void speed(const SpeedSample& sample) { prior_.distance.add(sample); }

  /// INS attitude: the first one with a sufficient sigma at a frame's time levels the map about the vehicle's position.
  /// Where there has been a pose, the reset counter increases.
  void add_attitude(const AttitudeSample& sample) { prior_.gravity.add(sample); }

  /// Restarts at this pose with the next frame. The map is discarded; a map that has started since the time of the pose
  /// is transformed to it and continues.
  void restart(const Restart& restart);

  /// The next frame; an older or equal time is refused and changes nothing.
  const TrackedFrame& process(const CameraFrame& frame);

  [[nodiscard]] const TrackedFrame& last() const { return out_; }
  /// Last pose extrapolated to another time with the last motion; invalid beyond the time limit.
  [[nodiscard]] Odometry at(int64_t t_us) const;
  /// What that pose shares with the whole trajectory, (S.10.1), (S.10.4).
  [[nodiscard]] ConsideredColumns considered_at(int64_t t_us) const;
  /// The same pose with all loops closed.
  [[nodiscard]] Odometry closed(Odometry odometry) const;

  /// Serialises everything that later frames depend on, between two frames; after load() the same frames give the same
  /// bits. load() throws on bytes that are no such state.
  void save(StateWriter& writer) const;
  void load(StateReader& reader);
  void digest(Digest& digest) const;

  [[nodiscard]] const LensCorrection& lens() const { return map().lens(); }

 private:
  /// Tracks of an image with a pose.
  struct TrackedImage {
    std::vector<Feature> features;
    bool is_keyframe = false;
    std::optional<StandstillSigma> standstill;
  };

  template <class Tracker, class Archive>
  static void members(Tracker& self, Archive& archive);
  [[nodiscard]] const LocalMap& map() const { return mapping_.map(); }

  void begin_frame(int64_t t_us);
  [[nodiscard]] TrackedImage track(const CameraFrame& frame);
  std::vector<Feature> add_keyframe(const CameraFrame& frame, const TrackedImage& image);
  void close_loop(const CameraFrame& frame, const std::vector<Feature>& features);
  void coast_or_lose(int64_t t_us, const std::string& reason);
  void end_frame(int64_t t_us);

  void initialise(const CameraFrame& frame);
  void initialise_again(const CameraFrame& frame);
  void initialise_stereo(const CameraFrame& frame);
  void initialise_mono(const CameraFrame& frame);
  void begin_two_views(const TwoViewMap& views);
  void begin_map(int64_t t_us, const std::optional<FrameMotion>& motion, const Matrix6d& cov_motion);
  void relocalise(const CameraFrame& frame);

  void finish_adjustment();
  void measure_scale();
  void reset_scale_drift();
  void level_map();
  void apply_restart(int64_t t_us);
  void clear_map();
  void drop_outliers();
  void accept_pose(int64_t t_us, const TrackedPose& pose);
  void set_pose(int64_t t_us, const SE3& T_map_camera, const Matrix6d& cov_image, const Matrix6d& cov_motion);
  void record_attitude(int64_t t_us);

  KeyframeTrackerConfig config_;
  CameraRig rig_;
  FeatureTracks tracks_;
  PoseTracking poses_;
  KeyframeCriterion criterion_;
  LocalMapping mapping_;
  LoopClosing loops_;
  Initialiser initialiser_;
  MotionPrior prior_;
  VehicleOdometry vehicle_;
  CameraState camera_;
  std::optional<Restart> restart_;  ///< and no frame since
  TrackedFrame out_;
};

}  // namespace roadfix
