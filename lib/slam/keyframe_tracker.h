/// Keyframe-based visual odometry, monocular or stereo. Derivation: lib/slam/MODEL.md, cited below as (S.n.m).
///
/// From image to pose in four files: features/klt_tracks.cpp tracks the features, slam/pose_solver.cpp solves the pose
/// from known points, slam/local_map.cpp adds a keyframe and triangulates points where needed, slam/bundle.cpp adjusts
/// the last keyframes. This class calls them in that order.
///
/// Frames: local has the vehicle's axes at the first pose until it is levelled by an INS; camera: the left one.
/// Monocular lengths are in an arbitrary unit until a scale is measured. A bundle adjustment started at one frame is
/// applied at the next, on any executor: same images, same bits.
#pragma once

#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>

#include "samples/samples.h"
#include "slam/config.h"
#include "slam/considered_scales.h"
#include "slam/distance_history.h"
#include "slam/local_map.h"
#include "slam/loop_closer.h"
#include "slam/pose_solver.h"
#include "stream/digest.h"
#include "stream/executor.h"

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
  /// Error of the pose per sigma of the common scales; its square is contained in the covariances.
  ScaleSensitivity scale_sensitivity = ScaleSensitivity::Zero();
  /// Errors that do not accumulate (S.11.1), in the order and axes of the pose covariance.
  Matrix6d cov_image = Matrix6d::Zero();   ///< of this image alone; contained in cov_pose
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
};

/// Attitude from an INS, for levelling.
struct AttitudeSample {
  int64_t t_us = 0;
  Eigen::Quaterniond q_level_vehicle = Eigen::Quaterniond::Identity();  ///< relative to axes with z up
  double sigma = 0.0;                                                   ///< rad, larger one of roll and pitch

  template <class Self, class Archive>
  static void members(Self& self, Archive& archive) {
    archive(self.t_us, self.q_level_vehicle.coeffs(), self.sigma);
  }
};

/// A pose to restart from.
struct Restart {
  int64_t t_us = 0;  ///< time of the pose; extrapolated with the velocity
  SE3 T_local_vehicle;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< m/s, vehicle axes
  Matrix6d cov_pose = Matrix6d::Zero();

  template <class Self, class Archive>
  static void members(Self& self, Archive& archive) {
    archive(self.t_us, self.T_local_vehicle, self.velocity, self.cov_pose);
  }
};

/// The camera's motion over the last frame.
struct FrameMotion {
  SE3 T_before_now;
  double dt_s = 0.0;

  template <class Self, class Archive>
  static void members(Self& self, Archive& archive) {
    archive(self.T_before_now, self.dt_s);
  }
};

/// First image of a monocular initialisation.
struct MonoStart {
  int64_t t_us = 0;
  std::map<int64_t, Eigen::Vector2d> seen;  ///< normalised, by track

  template <class Self, class Archive>
  static void members(Self& self, Archive& archive) {
    archive(self.t_us, self.seen);
  }
};

class KeyframeTracker {
 public:
  /// `right_matcher`: for simulated tracks; by default images are matched.
  KeyframeTracker(const KeyframeTrackerConfig& config, const CameraRig& rig, std::unique_ptr<FrontEnd> front_end,
                  Executor& executor, std::unique_ptr<RightImageMatcher> right_matcher = nullptr);
  ~KeyframeTracker();
  KeyframeTracker(const KeyframeTracker&) = delete;
  KeyframeTracker& operator=(const KeyframeTracker&) = delete;

  /// Vehicle speed from wheels or an INS: the source of the monocular scale. Used from the next frame on, also for past
  /// distances: speeds may be older than the last frame.
  void speed(const SpeedSample& sample) { new_speeds_.push_back(sample); }

  /// INS attitude: the first one with a sufficient sigma at a frame's time levels the map about the vehicle's position.
  /// Where there has been a pose, the reset counter increases.
  void add_attitude(const AttitudeSample& sample) { new_attitudes_.push_back(sample); }

  /// Restarts at this pose with the next frame. The map is discarded; a map that has started since the time of the pose
  /// is transformed to it and continues.
  void restart(const Restart& restart);

  /// The next frame; an older or equal time is refused and changes nothing.
  const TrackedFrame& process(const CameraFrame& frame);

  [[nodiscard]] const TrackedFrame& last() const { return out_; }
  /// Last pose extrapolated to another time with the last motion; invalid beyond the time limit.
  [[nodiscard]] Odometry at(int64_t t_us) const;
  /// Scale sensitivity of that pose.
  [[nodiscard]] ScaleSensitivity scale_sensitivity_at(int64_t t_us) const;
  /// The same pose with all loops closed.
  [[nodiscard]] Odometry closed(Odometry odometry) const;

  /// Serialises everything that later frames depend on, between two frames; after load() the same frames give the same
  /// bits. load() throws on bytes that are no such state.
  void save(StateWriter& writer) const;
  void load(StateReader& reader);
  void digest(Digest& digest) const;

  [[nodiscard]] const LensCorrection& lens() const { return map_.lens(); }

 private:
  struct Attitude {
    int64_t t_us = 0;
    Eigen::Quaterniond q_map_vehicle = Eigen::Quaterniond::Identity();

    template <class Self, class Archive>
    static void members(Self& self, Archive& archive) {
      archive(self.t_us, self.q_map_vehicle.coeffs());
    }
  };
  struct Pairs {  ///< tracks in the first image of an initialisation and in this one, normalised
    std::vector<int64_t> tracks;
    std::vector<Eigen::Vector2d> first, second;
  };

  template <class Tracker, class Archive>
  static void members(Tracker& self, Archive& archive);
  [[nodiscard]] std::string rejection_reason(const CameraFrame& frame);
  void finish_bundle();
  void begin_bundle();
  void add_scale_drift(const BundleJob& job);
  void start(const CameraFrame& frame);
  void restart_after_loss(const std::string& loss, const CameraFrame& frame);
  void start_stereo(const CameraFrame& frame);
  void start_mono(const CameraFrame& frame);
  void wait_for_parallax(int64_t t_us, size_t points);
  void begin_initialisation(const CameraFrame& frame, const std::vector<Feature>& features);
  void finish_initialisation(const CameraFrame& frame, const Pairs& pairs);
  void begin_map(int64_t t_us, const std::optional<FrameMotion>& motion, const Matrix6d& cov_motion);
  /// Distance of the vehicle, from the source with the smallest sigma; no value without a source.
  struct MeasuredDistance {
    TravelledDistance travelled;
    SpeedSource source = SpeedSource::kWheels;
  };
  [[nodiscard]] std::optional<MeasuredDistance> measured_distance(int64_t begin_us, int64_t end_us) const;
  /// The same for the camera, between two of its poses.
  [[nodiscard]] std::optional<MeasuredDistance> camera_distance(int64_t begin_us, const SE3& T_map_begin,
                                                                int64_t end_us, const SE3& T_map_end) const;
  void add_speeds();
  void record_attitude(int64_t t_us);
  void apply_levelling();
  void rotate_map(const Eigen::Quaterniond& q, double sigma);
  void initialise_scale();
  void set_scale_source(const MeasuredDistance& known);
  void clear_map();
  /// A past camera pose that the current tracks refer to.
  struct ReferencePose {
    int64_t t_us = 0;
    SE3 T_map_camera;
  };
  [[nodiscard]] std::optional<ReferencePose> reference_pose_near(int64_t given_us, int64_t now_us) const;
  /// State without a map: initialising or lost; `usable`: this image can start or continue an initialisation.
  [[nodiscard]] TrackState state_without_map(int64_t t_us, bool usable);
  void apply_restart(int64_t t_us);
  void transform_map(const SE3& T_new_old);
  [[nodiscard]] int count_landmarks(const std::vector<KeyframeFeature>& features) const;
  void track_frame(const CameraFrame& frame);
  [[nodiscard]] SE3 predict(int64_t t_us) const;
  /// Pixel of a point in camera axes, lens correction included.
  [[nodiscard]] std::optional<Eigen::Vector2d> project_pixel(const Eigen::Vector3d& p_camera) const;
  struct KnownDepth {
    Eigen::Vector2f pixel;
    double inverse_depth = 0.0;
  };
  [[nodiscard]] std::vector<KnownDepth> known_depths() const;
  [[nodiscard]] std::vector<Feature> predicted_features(const SE3& T_map_camera) const;
  [[nodiscard]] bool rotation_plausible(const Eigen::Quaterniond& q_expected, const Eigen::Quaterniond& q_found) const;
  [[nodiscard]] bool solve(const std::vector<Feature>& features, const SE3& T_predicted);
  [[nodiscard]] ScaleSigmas scale_sigmas() const;
  void set_output_pose(const SE3& T_map_camera, const Matrix6d& cov_camera);
  void set_output_motion(const Eigen::Matrix3d& cov_velocity);
  void drop_outlier_tracks(const std::vector<Feature>& features);
  void update_redetection_rate();
  [[nodiscard]] std::vector<Eigen::Vector2d> shifts_without_rotation(const Eigen::Quaterniond& q_now_keyframe,
                                                                     const std::vector<Feature>& features) const;
  [[nodiscard]] bool hold_at_standstill(const CameraFrame& frame, const std::vector<Feature>& features);
  [[nodiscard]] bool track_bearing_only(const CameraFrame& frame, const std::vector<Feature>& features);
  [[nodiscard]] int num_point_candidates(const std::vector<Feature>& features) const;
  [[nodiscard]] bool needs_keyframe(const std::vector<Feature>& features) const;
  void make_keyframe(const CameraFrame& frame, const std::vector<Feature>& features,
                     const std::optional<StandstillSigma>& standstill = {});
  void record_right_pixels(const std::vector<Feature>& features,
                           const std::vector<std::optional<Eigen::Vector2f>>& right);
  void add_place(const CameraFrame& frame, const std::vector<Feature>& features);
  void relocalise(const CameraFrame& frame);
  [[nodiscard]] PlaceView make_place_view(const cv::Mat& gray, const std::vector<Feature>& features,
                                          int64_t t_us) const;
  void coast_or_lose(int64_t t_us, const std::string& reason);
  void accept_pose(int64_t t_us, const SE3& T_map_camera, const Matrix6d& cov_camera);
  void set_pose(int64_t t_us, const SE3& T_map_camera, const Matrix6d& cov_camera, const Matrix6d& cov_motion);

  KeyframeTrackerConfig config_;
  CameraRig rig_;
  Camera left_;
  std::unique_ptr<RightImageMatcher> stereo_;  ///< null without a right camera
  std::unique_ptr<FrontEnd> front_end_;
  Executor& executor_;
  LocalMap map_;
  std::unique_ptr<BundleJob> job_;
  TrackedFrame out_;
  SE3 T_map_camera_;  ///< at the last processed frame
  std::optional<int64_t> t_us_;
  std::optional<int64_t> t_good_us_;    ///< of the last frame with a pose
  std::optional<int64_t> t_usable_us_;  ///< of the last frame usable for an initialisation, or of the first attempt
  std::optional<FrameMotion> motion_;
  std::optional<MonoStart> start_;
  std::map<int64_t, Eigen::Vector2f> pixels_;  ///< of the active tracks in the last image
  int landmarks_at_keyframe_ = 0;
  double redetection_rate_ = 1.0;  ///< filtered share of a keyframe's landmarks found in the next image: a property
                                   ///< of the front end
  bool after_keyframe_ = false;    ///< the last frame was a keyframe
  Matrix6d cov_keyframe_ = Matrix6d::Zero();         ///< of the last keyframe's camera pose, accumulated, (S.9.1)
  Matrix6d cov_own_ = Matrix6d::Zero();              ///< the share of it that this map has added
  Matrix6d cov_window_ = Matrix6d::Zero();           ///< of the last keyframe relative to the fixed ones, (S.9.2)
  Matrix6d cov_closed_ = Matrix6d::Zero();           ///< like cov_keyframe_, with all loops closed
  ConsideredScales considered_, considered_closed_;  ///< of the last output pose, and of it with all loops closed
  LoopCloser loops_;
  std::optional<int64_t> t_begun_us_;  ///< start of the map
  int64_t first_place_ = 0;            ///< first place of this map
  bool continuous_ = false;            ///< no jump since the last place
  bool relocalised_ = false;           ///< the next map starts at a recognised place
  std::vector<SpeedSample> new_speeds_;
  DistanceHistory wheels_, ins_;
  std::vector<AttitudeSample> new_attitudes_;
  std::deque<Attitude> attitudes_;          ///< of the last frames, until the map is level
  bool levelled_ = false;                   ///< by an INS, or replaced by a restart pose
  ScaleSource scale_ = ScaleSource::kNone;  ///< of the map
  double scale_std_ = 0.0;
  bool restarted_ = false;  ///< and no frame since
  Restart restart_;
};

}  // namespace roadfix
