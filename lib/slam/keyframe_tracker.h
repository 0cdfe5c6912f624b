/// Visual odometry from keyframes, mono or stereo. Derivation: lib/slam/MODEL.md, cited below as (M.n).
///
/// One frame from picture to pose, in four files: features/klt_tracks.cpp finds the tracks again, slam/pose_solver.cpp
/// turns those whose points are known into a pose, slam/local_map.cpp makes a keyframe and new points where needed,
/// slam/bundle.cpp adjusts the last keyframes. This class calls them in that order.
///
/// Frames: local has the vehicle's axes at the first pose until an INS says where up is; the map's coordinates. camera:
/// the left eye. Without stereo lengths are in a unit of the tracker's own until something else gives their scale. A
/// bundle adjustment begun at one frame is applied at the next, wherever it runs: same pictures, same bits.
#pragma once

#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>

#include "samples/samples.h"
#include "slam/config.h"
#include "slam/local_map.h"
#include "slam/loop_closer.h"
#include "slam/pose_solver.h"
#include "slam/shared_error.h"
#include "slam/travel.h"
#include "stream/digest.h"
#include "stream/executor.h"

namespace roadfix {

struct CameraFrame {
  int64_t t_us = 0;
  cv::Mat left;   ///< 8-bit grey
  cv::Mat right;  ///< empty without stereo
};

enum class TrackState { kInitialising, kGood, kWeak, kLost, kRelocalised };
enum class ScaleSource { kNone, kStereo, kWheels, kIns };
enum class FeatureUse : int8_t { kNew, kMatched, kInlier, kOutlier };

struct UsedFeature {
  Feature feature;
  FeatureUse use = FeatureUse::kNew;
  std::optional<Eigen::Vector2f> right = {};  ///< its pixel in the right picture, of a keyframe
};

/// What one frame gave.
struct TrackedFrame {
  Odometry odometry;  ///< frame local; invalid unless the state is good, weak or relocalised
  TrackState state = TrackState::kInitialising;
  bool map_began = false;  ///< at this frame
  std::string reason;      ///< plain words, empty when good
  ScaleSource scale = ScaleSource::kNone;
  double scale_std = 0.0;  ///< relative, common to the whole way; meaningless where the source is none
  /// Error of odometry's pose per sigma of what the whole way shares; its square is in the covariances.
  SharedColumns shared_error = SharedColumns::Zero();
  /// Of odometry's error what does not add up along the way (M.23), with the order and axes of its covariance.
  Matrix6d cov_picture = Matrix6d::Zero();  ///< this picture's alone; contained in cov_pose
  Matrix6d cov_map = Matrix6d::Zero();      ///< of the local map that it is seen against,
  double map_time = 0.0;                    ///< s, which that map spans
  int reset_counter = 0;                    ///< +1 per jump of the pose
  SE3 reset_delta;                          ///< of the last jump: p is new minus old, q is q_old^-1 q_new
  Matrix6d cov_closed = Matrix6d::Zero();   ///< of the pose with all loops closed
  int closed_reset_counter = 0;             ///< of that pose: it jumps where a loop is closed, odometry does not
  SE3 closed_reset_delta;
  int num_loops = 0;
  std::vector<UsedFeature> features;
  int num_expected = 0;        ///< tracks looked for
  int num_matches = 0;         ///< tracks found again
  int num_landmarks_seen = 0;  ///< of these, whose points are known: only they can be judged
  int num_inliers = 0;         ///< of these, that agree with the pose
  double rms_px = 0.0;
  double brightness = 0.0;  ///< mean grey level
  int64_t num_keyframes = 0;
  int64_t num_landmarks = 0;
};

/// Which way is up, of an INS.
struct LevelSample {
  int64_t t_us = 0;
  Eigen::Quaterniond q_level_vehicle = Eigen::Quaterniond::Identity();  ///< against axes of which z is up
  double sigma = 0.0;                                                   ///< rad, of roll and pitch, the worse one

  template <class Self, class Archive>
  static void members(Self& self, Archive& archive) {
    archive(self.t_us, self.q_level_vehicle.coeffs(), self.sigma);
  }
};

/// A pose from which to start again.
struct Restart {
  int64_t t_us = 0;  ///< of the pose; the vehicle goes on from there with the velocity
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

/// The first picture of a start without stereo.
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
  /// `right_matcher`: for simulated tracks; without it pictures are matched.
  KeyframeTracker(const KeyframeTrackerConfig& config, const CameraRig& rig, std::unique_ptr<FrontEnd> front_end,
                  Executor& executor, std::unique_ptr<RightImageMatcher> right_matcher = nullptr);
  ~KeyframeTracker();
  KeyframeTracker(const KeyframeTracker&) = delete;
  KeyframeTracker& operator=(const KeyframeTracker&) = delete;

  /// A speed of the vehicle from wheels or an INS: gives mono its scale. It counts from the next frame on, for the past
  /// as well: speeds may come later than the frames of their time.
  void speed(const SpeedSample& sample) { new_speeds_.push_back(sample); }

  /// An INS's attitude: the first that is good enough and of a frame's time turns the map level, about the vehicle. The
  /// reset counter says so where there has been a pose.
  void level(const LevelSample& sample) { new_levels_.push_back(sample); }

  /// Starts again at this pose, with the next frame. The map is forgotten; one that has begun since the time of the
  /// pose is not what anybody complained of: it is moved there, and goes on.
  void restart(const Restart& restart);

  /// The next frame; an older or equal time is refused and changes nothing.
  const TrackedFrame& process(const CameraFrame& frame);

  [[nodiscard]] const TrackedFrame& last() const { return out_; }
  /// The last frame's pose carried to another time by the last motion; invalid where that is long after it.
  [[nodiscard]] Odometry at(int64_t t_us) const;
  /// What that pose shares with the whole way.
  [[nodiscard]] SharedColumns shared_error_at(int64_t t_us) const;
  /// The same pose with all loops closed.
  [[nodiscard]] Odometry closed(Odometry odometry) const;

  /// Everything that later frames depend on. To be called between two frames; after load() the same frames give the
  /// same bits. load() throws where the bytes are no such state.
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
  struct Pairs {  ///< tracks in the first picture of a start and in this one, normalised
    std::vector<int64_t> tracks;
    std::vector<Eigen::Vector2d> first, second;
  };

  template <class Tracker, class Archive>
  static void members(Tracker& self, Archive& archive);
  [[nodiscard]] std::string unusable(const CameraFrame& frame);
  void finish_bundle();
  void begin_bundle();
  void lose_scale(const BundleJob& job);
  void start(const CameraFrame& frame);
  void start_after(const std::string& loss, const CameraFrame& frame);
  void start_stereo(const CameraFrame& frame);
  void start_mono(const CameraFrame& frame);
  void wait_for_parallax(int64_t t_us, size_t points);
  void begin_start(const CameraFrame& frame, const std::vector<Feature>& features);
  void finish_start(const CameraFrame& frame, const Pairs& pairs);
  void begin_map(int64_t t_us, const std::optional<FrameMotion>& motion, const Matrix6d& cov_motion);
  /// Way of the vehicle, with the source that knows it best; nothing where none does or none is wanted.
  struct KnownTravel {
    Travel travel;
    SpeedSource source = SpeedSource::kWheels;
  };
  [[nodiscard]] std::optional<KnownTravel> travelled(int64_t begin_us, int64_t end_us) const;
  /// The same of the camera, between two of its poses.
  [[nodiscard]] std::optional<KnownTravel> camera_travelled(int64_t begin_us, const SE3& T_map_begin, int64_t end_us,
                                                            const SE3& T_map_end) const;
  void take_speeds();
  void note_attitude(int64_t t_us);
  void take_level();
  void turn_map(const Eigen::Quaterniond& q, double sigma);
  void take_scale();
  void name_scale(const KnownTravel& known);
  void forget_map();
  /// A pose of the camera that what is being tracked hangs on.
  struct Anchor {
    int64_t t_us = 0;
    SE3 T_map_camera;
  };
  [[nodiscard]] std::optional<Anchor> anchor_near(int64_t given_us, int64_t now_us) const;
  /// Initialising or lost, where there is no map; `able`: this picture could begin one, or go on beginning one.
  [[nodiscard]] TrackState without_map(int64_t t_us, bool able);
  void arrive(int64_t t_us);
  void move_to(const SE3& T_new_old);
  [[nodiscard]] int count_landmarks(const std::vector<KeyframeFeature>& features) const;
  void follow(const CameraFrame& frame);
  [[nodiscard]] SE3 predict(int64_t t_us) const;
  /// Pixel of a point in camera axes, lens correction included.
  [[nodiscard]] std::optional<Eigen::Vector2d> appears(const Eigen::Vector3d& p_camera) const;
  struct KnownDepth {
    Eigen::Vector2f pixel;
    double inverse_depth = 0.0;
  };
  [[nodiscard]] std::vector<KnownDepth> known_depths() const;
  [[nodiscard]] std::vector<Feature> hints(const SE3& T_map_camera) const;
  [[nodiscard]] bool can_turn(const Eigen::Quaterniond& q_expected, const Eigen::Quaterniond& q_found) const;
  [[nodiscard]] bool solve(const std::vector<Feature>& features, const SE3& T_predicted);
  [[nodiscard]] SharedDoubt shared_doubt() const;
  void tell_pose(const SE3& T_map_camera, const Matrix6d& cov_camera);
  void tell_motion(const Eigen::Matrix3d& cov_velocity);
  void drop_wrong_tracks(const std::vector<Feature>& features);
  void learn_found_share();
  [[nodiscard]] std::vector<Eigen::Vector2d> shifts_beyond(const Eigen::Quaterniond& q_now_keyframe,
                                                           const std::vector<Feature>& features) const;
  [[nodiscard]] bool hold(const CameraFrame& frame, const std::vector<Feature>& features);
  [[nodiscard]] bool pull_away(const CameraFrame& frame, const std::vector<Feature>& features);
  [[nodiscard]] int num_ripe(const std::vector<Feature>& features) const;
  [[nodiscard]] bool needs_keyframe(const std::vector<Feature>& features) const;
  void make_keyframe(const CameraFrame& frame, const std::vector<Feature>& features,
                     const std::optional<StandingDoubt>& stood = {});
  void show_right(const std::vector<Feature>& features, const std::vector<std::optional<Eigen::Vector2f>>& right);
  void remember_place(const CameraFrame& frame, const std::vector<Feature>& features);
  void find_back(const CameraFrame& frame);
  [[nodiscard]] PlaceView view_of(const cv::Mat& gray, const std::vector<Feature>& features, int64_t t_us) const;
  void miss(int64_t t_us, const std::string& reason);
  void accept(int64_t t_us, const SE3& T_map_camera, const Matrix6d& cov_camera);
  void settle(int64_t t_us, const SE3& T_map_camera, const Matrix6d& cov_camera, const Matrix6d& cov_motion);

  KeyframeTrackerConfig config_;
  CameraRig rig_;
  Camera left_;
  std::unique_ptr<RightImageMatcher> stereo_;  ///< null without a right eye
  std::unique_ptr<FrontEnd> front_end_;
  Executor& executor_;
  LocalMap map_;
  std::unique_ptr<BundleJob> job_;
  TrackedFrame out_;
  SE3 T_map_camera_;  ///< at the last processed frame
  std::optional<int64_t> t_us_;
  std::optional<int64_t> t_good_us_;  ///< of the last frame with a pose
  std::optional<int64_t> t_able_us_;  ///< of the last frame that could begin a map, or of the first to try
  std::optional<FrameMotion> motion_;
  std::optional<MonoStart> start_;
  std::map<int64_t, Eigen::Vector2f> pixels_;  ///< of the live tracks in the last picture
  int landmarks_at_keyframe_ = 0;
  double found_share_ = 1.0;     ///< of a keyframe's landmarks, in the picture after it: the front end's own, a mean
  bool after_keyframe_ = false;  ///< the last frame was made a keyframe
  Matrix6d cov_keyframe_ = Matrix6d::Zero();  ///< of the last keyframe's camera pose, grown along the way, (M.14)
  Matrix6d cov_own_ = Matrix6d::Zero();       ///< what of it this map has added
  Matrix6d cov_window_ = Matrix6d::Zero();    ///< of the last keyframe against those that are held, (M.16)
  Matrix6d cov_closed_ = Matrix6d::Zero();    ///< like cov_keyframe_, with all loops closed
  SharedError shared_, shared_closed_;        ///< of the last pose told, and of it with all loops closed
  LoopCloser loops_;
  std::optional<int64_t> t_begun_us_;  ///< when the map began
  int64_t first_place_ = 0;            ///< of this map
  bool continuous_ = false;            ///< no jump since the last place
  bool found_back_ = false;            ///< the next map begins at a place known from before
  std::vector<SpeedSample> new_speeds_;
  TravelHistory wheels_, ins_;
  std::vector<LevelSample> new_levels_;
  std::deque<Attitude> attitudes_;          ///< of the last frames, until the map is level
  bool levelled_ = false;                   ///< or was told where it is
  ScaleSource scale_ = ScaleSource::kNone;  ///< of the map
  double scale_std_ = 0.0;
  bool restarted_ = false;  ///< and no frame since
  Restart restart_;
};

}  // namespace roadfix
