/// Visual odometry from keyframes, mono or stereo. Derivation: lib/slam/MODEL.md, cited below as (M.n).
///
/// One frame from picture to pose, in four files: features/klt_tracks.cpp finds the tracks again, slam/pose_solver.cpp
/// turns those whose points are known into a pose, slam/local_map.cpp makes a keyframe and new points where needed,
/// slam/bundle.cpp adjusts the last keyframes. This class calls them in that order.
///
/// Frames: local level as the vehicle was at the first pose; the map's coordinates. camera: the left eye.
/// Without stereo lengths are in a unit of the tracker's own until something else gives their scale.
/// A bundle adjustment begun at one frame is applied at the next, wherever it runs: same pictures, same bits.
#pragma once

#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>

#include "samples/samples.h"
#include "slam/config.h"
#include "slam/executor.h"
#include "slam/local_map.h"
#include "slam/pose_solver.h"

namespace roadfix {

struct CameraFrame {
  int64_t t_us = 0;
  cv::Mat left;   ///< 8-bit grey
  cv::Mat right;  ///< empty without stereo
};

enum class TrackState { kInitialising, kGood, kWeak, kLost, kRelocalised };
enum class ScaleSource { kNone, kStereo, kTravel };
enum class FeatureUse : int8_t { kNew, kMatched, kInlier, kOutlier };

struct UsedFeature {
  Feature feature;
  FeatureUse use = FeatureUse::kNew;
};

/// What one frame gave.
struct TrackedFrame {
  Odometry odometry;  ///< frame local; invalid unless the state is good, weak or relocalised
  TrackState state = TrackState::kInitialising;
  std::string reason;  ///< plain words, empty when good
  ScaleSource scale = ScaleSource::kNone;
  int reset_counter = 0;  ///< +1 per jump of the pose
  SE3 reset_delta;        ///< of the last jump: p is new minus old, q is q_old^-1 q_new
  std::vector<UsedFeature> features;
  int num_expected = 0;  ///< tracks looked for
  int num_matches = 0;   ///< tracks found again
  int num_inliers = 0;   ///< of the landmarks among them, those that agree with the pose
  int num_landmarks_seen = 0;
  double rms_px = 0.0;
  double brightness = 0.0;  ///< mean grey level
  int64_t num_keyframes = 0;
  int64_t num_landmarks = 0;
};

class KeyframeTracker {
 public:
  KeyframeTracker(const KeyframeTrackerConfig& config, const CameraRig& rig, std::unique_ptr<FrontEnd> front_end,
                  Executor& executor);
  ~KeyframeTracker();
  KeyframeTracker(const KeyframeTracker&) = delete;
  KeyframeTracker& operator=(const KeyframeTracker&) = delete;

  /// Distance that the vehicle has travelled since the frame before, m, and its standard deviation: from wheels or an
  /// INS. Gives mono its scale. Call before process() of the frame that it leads to.
  void travelled(double distance, double sigma);

  /// Starts again at this pose: the map is forgotten, the next frame has it.
  void restart(const SE3& T_local_vehicle, const Matrix6d& cov_pose);

  /// The next frame; an older or equal time is refused and changes nothing.
  const TrackedFrame& process(const CameraFrame& frame);

  [[nodiscard]] const TrackedFrame& last() const { return out_; }
  [[nodiscard]] const LensCorrection& lens() const { return map_.lens(); }

 private:
  struct Motion {
    SE3 T_before_now;  ///< of the camera, over the last frame
    double dt_s = 0.0;
  };
  struct Start {  ///< the first picture of a start without stereo
    int64_t t_us = 0;
    std::map<int64_t, Eigen::Vector2d> seen;  ///< normalised, by track
  };
  struct Pairs {  ///< tracks in the first picture of a start and in this one, normalised
    std::vector<int64_t> tracks;
    std::vector<Eigen::Vector2d> first, second;
  };

  [[nodiscard]] std::string unusable(const CameraFrame& frame);
  void finish_bundle();
  void begin_bundle();
  void start_stereo(const CameraFrame& frame);
  void start_mono(const CameraFrame& frame);
  void begin_start(const CameraFrame& frame, const std::vector<Feature>& features);
  void finish_start(const CameraFrame& frame, const Pairs& pairs);
  void begin_map(int64_t t_us);
  [[nodiscard]] int count_landmarks(const std::vector<KeyframeFeature>& features) const;
  void follow(const CameraFrame& frame);
  [[nodiscard]] SE3 predict(int64_t t_us) const;
  /// Pixel of a point in camera axes, lens correction included.
  [[nodiscard]] std::optional<Eigen::Vector2d> appears(const Eigen::Vector3d& p_camera) const;
  [[nodiscard]] std::vector<Feature> hints(const SE3& T_map_camera) const;
  [[nodiscard]] bool solve(const std::vector<Feature>& features, const SE3& T_predicted);
  void drop_wrong_tracks(const std::vector<Feature>& features);
  [[nodiscard]] bool needs_keyframe(const std::vector<Feature>& features) const;
  void make_keyframe(const CameraFrame& frame, const std::vector<Feature>& features);
  void miss(int64_t t_us, const std::string& reason);
  void accept(int64_t t_us, const SE3& T_map_camera, const Matrix6d& cov_camera);

  KeyframeTrackerConfig config_;
  CameraRig rig_;
  Camera left_;
  std::optional<StereoMatcher> stereo_;
  std::unique_ptr<FrontEnd> front_end_;
  Executor& executor_;
  LocalMap map_;
  std::unique_ptr<BundleJob> job_;
  TrackedFrame out_;
  SE3 T_map_camera_;  ///< at the last processed frame
  std::optional<int64_t> t_us_;
  std::optional<int64_t> t_good_us_;  ///< of the last frame with a pose
  std::optional<Motion> motion_;
  std::optional<Start> start_;
  std::map<int64_t, Eigen::Vector2f> pixels_;  ///< of the live tracks in the last picture
  int landmarks_at_keyframe_ = 0;
  Matrix6d cov_keyframe_ = Matrix6d::Zero();  ///< of the last keyframe's camera pose, grown along the way, (M.14)
  double travelled_ = 0.0, travelled_variance_ = 0.0;  ///< since the last keyframe
  bool travel_known_ = false;
};

}  // namespace roadfix
