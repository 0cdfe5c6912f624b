/// Visual-inertial odometry: a multi-state constraint Kalman filter (Mourikis and Roumeliotis 2007) with the
/// right-invariant error, long-lived points, what is known about cars, and online calibration. Derivation:
/// lib/msckf/MODEL.md.
///
/// Frame local: z up, x along the vehicle's heading at the start, origin at the imu there. vehicle: the imu's axes and
/// origin (body of the calibration).
/// Time: everything comes in the order of its stamps (add); advance() hands in imu samples and lets the state follow,
/// behind them by the largest time offset that the calibration allows. output() is for the newest imu sample.
/// Same inputs in the same order give the same bits. One thread; memory is bounded.
#pragma once

#include <cmath>
#include <deque>
#include <span>
#include <string>
#include <vector>

#include "msckf/clock_search.h"
#include "msckf/point_update.h"
#include "msckf/propagation.h"
#include "msckf/stamp_line.h"
#include "msckf/standing.h"
#include "msckf/track_depths.h"
#include "msckf/vehicle_aiding.h"
#include "samples/samples.h"

namespace roadfix {

enum class MsckfPhase { kStarting, kRunning, kLost };
enum class MsckfScale { kUnknown, kInertial, kWheels, kIns, kStereo };

/// A pose to begin again at.
struct MsckfRestart {
  int64_t t_us = 0;  ///< of the pose; the imu's samples tell the way since
  SE3 T_local_vehicle;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< m/s, vehicle axes
  Matrix6d cov_pose = Matrix6d::Zero();                ///< as Odometry::cov_pose
};

struct MsckfOutput {
  Odometry odometry;
  MsckfPhase phase = MsckfPhase::kStarting;
  MsckfScale scale = MsckfScale::kUnknown;
  bool standing = false;
  std::string reason;  ///< plain words; empty when all is well
  int reset_counter = 0;
  SE3 reset_delta;  ///< of the newest reset: q turns the old attitude on the right, p is added to the old position
  int num_landmarks = 0;
  int num_tracks = 0;       ///< in the newest picture
  double used_share = 1.0;  ///< of the points tried lately, those that fitted
};

namespace msckf {

/// A speed over ground from elsewhere, for a start in motion.
struct KnownSpeed {
  int64_t t_us = 0;
  double speed = 0.0, sigma = 0.0;  ///< m/s
  MsckfScale from = MsckfScale::kInertial;
};

/// How fast it goes, by two eyes, for a start in motion.
struct KnownVelocity {
  int64_t t_us = 0;
  Eigen::Vector3d v = Eigen::Vector3d::Zero();    ///< m/s, of the imu in its axes
  Eigen::Matrix3d cov = Eigen::Matrix3d::Zero();  ///< (m/s)2
};

/// Where a start in motion begins.
struct Beginning {
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ(), v = Eigen::Vector3d::Zero();  ///< imu axes
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero(), accel_bias = Eigen::Vector3d::Zero();
  Calibrated camera;
};

/// A start in motion that is planned, and what is known of it.
struct MovingStart {
  int64_t t_us = 0;
  int64_t length_us = 0;  ///< of what will be gone through
  Beginning at;
  Eigen::Matrix3d cov_v = Eigen::Matrix3d::Zero();  ///< of the velocity, imu axes
  double tilt_std = 0.0;
  MsckfScale scale = MsckfScale::kUnknown;
};

}  // namespace msckf

class Msckf {
 public:
  explicit Msckf(const MsckfConfig& config);

  void add(const msckf::SeenFrame& frame);
  void add(const WheelSample& wheels);
  /// Speed over ground known from elsewhere (an INS), for a start in motion only.
  void add_speed(int64_t t_us, double speed, double sigma);
  /// The horizon has passed this sample. False where it is refused: not newer, or not finite.
  bool advance(const ImuSample& imu);
  /// Forgets what it knows and begins again there, (M.41). False, and nothing has changed, where a number is not finite
  /// or no sample as new as the pose has been handed in.
  bool restart(const MsckfRestart& restart);

  /// Carried to `ahead`, newest samples that advance() has not seen yet, oldest first.
  [[nodiscard]] MsckfOutput output(std::span<const ImuSample> ahead = {}) const;
  /// Motion of the camera from one stamp to another by the imu, its turn alone while it is not running; nothing where
  /// the samples do not reach. `ahead`: as for output(); a late camera's pictures are newer than what advance() saw.
  [[nodiscard]] std::optional<CameraMotion> camera_motion(int64_t before_us, int64_t now_us,
                                                          std::span<const ImuSample> ahead = {}) const;
  /// Nothing before the first start.
  [[nodiscard]] const msckf::State* state() const { return phase_ == MsckfPhase::kRunning ? &state_ : nullptr; }
  /// s, standard deviation of the camera's time offset.
  [[nodiscard]] double time_offset_std() const { return std::sqrt(state_.P()(msckf::kTimeOffset, msckf::kTimeOffset)); }
  [[nodiscard]] const msckf::PointCounts& counts() const { return points_.counts(); }
  [[nodiscard]] const MsckfConfig& config() const { return config_; }

  void digest(Digest& digest) const;
  /// Everything that later outputs depend on; load() throws std::runtime_error on bytes that are no such state.
  [[nodiscard]] std::vector<uint8_t> save() const;
  void load(std::span<const uint8_t> bytes);

 private:
  static constexpr double kMaxGap_s = 0.5;  ///< of imu samples

  void follow(int64_t until_us);
  void use_waiting(int64_t until_us);
  void propagate(int64_t t_us);
  [[nodiscard]] bool use(const msckf::SeenFrame& frame);
  void use(const WheelSample& wheels);
  void use_picture(const msckf::SeenFrame& frame);
  void use_tracks(bool window_full);
  /// The next imu sample, its camera's clock known.
  void take(const ImuSample& imu);
  /// Keeps what the clock's search keeps, up to now.
  void wait_for_clock(int64_t now_us);
  /// The camera's clock is known from now on: what has waited for it is gone through, (M.47).
  void settle_clock(const msckf::ClockSearch::Found& found);
  void use_vehicle(const WheelSample* wheels);
  void use_standing();
  bool try_linear(msckf::Linear linear, double gate_sigma);
  [[nodiscard]] bool due(int64_t& next_us, double interval_s) const;
  [[nodiscard]] double axle_speed(const WheelSample& wheels) const;
  [[nodiscard]] int64_t picture_us(const msckf::SeenFrame& frame) const;

  bool start_standing(int64_t t_us);
  /// Decides on a start in motion here; it begins some seconds later, when they can be gone through.
  bool plan_moving(int64_t t_us);
  bool start_planned(int64_t until_us);
  /// m/s, standard deviation along the way.
  [[nodiscard]] double speed_std() const;
  [[nodiscard]] bool speed_known() const;
  /// Where nothing tells a speed: from the last seconds' pictures, whenever they are there and told it, (M.50).
  bool start_in_past(const msckf::SeenFrame& now);
  [[nodiscard]] std::optional<msckf::MovingStart> plan_in_past(int64_t begin_us, int64_t end_us) const;
  bool try_past(const msckf::MovingStart& plan);
  /// Begins at `at` and uses what waits up to `end_us`; with `fixed`, linearised along the course that `at` gives.
  void go_through(const msckf::MovingStart& plan, const msckf::Beginning& at, int64_t end_us, bool fixed);
  void begin_moving(const msckf::MovingStart& plan, const msckf::Beginning& at);
  /// What the plan says of the errors of a state that begins at `at`.
  [[nodiscard]] Eigen::Matrix<double, msckf::kBaseSize, 1> expected_errors(const msckf::MovingStart& plan) const;
  /// Where the state began, by what is known now.
  [[nodiscard]] std::optional<msckf::Beginning> beginning(int64_t from_us) const;
  /// Integrates the imu's samples from there to now.
  void carry(msckf::ImuState& x, int64_t from_us) const;
  [[nodiscard]] std::optional<msckf::KnownSpeed> speed_for_start(int64_t t_us) const;
  /// What the eyes say of the velocity, as a plan begins with it.
  [[nodiscard]] bool plan_by_eyes(int64_t t_us, msckf::MovingStart& plan) const;
  void plan_by_speed(const msckf::KnownSpeed& known, msckf::MovingStart& plan) const;
  /// Two eyes' velocity from a picture that no start will use, and the one before.
  void watch(const msckf::SeenFrame& frame);
  void begin_at(int64_t t_us, const Eigen::Vector3d& up_in_imu, const Eigen::Vector3d& v_imu, double v_std,
                double tilt_std);
  void judge(int64_t t_us);
  void lose(const std::string& reason);
  /// Of the newest imu sample; where it was lost while it is not running.
  [[nodiscard]] SE3 newest_pose() const;

  template <class Archive>
  void serialise(Archive& a);

  MsckfConfig config_;
  int64_t lag_us_ = 0;
  msckf::State state_;
  msckf::Propagation propagation_;
  msckf::PointUpdate points_;
  msckf::Update update_;
  msckf::TrackStore tracks_;
  msckf::Standing standing_;
  msckf::StampLine stamps_;
  msckf::ClockSearch clock_;
  std::deque<ImuSample> imu_;  ///< from the sample that contains the state's epoch on
  std::deque<msckf::SeenFrame> frames_;
  std::deque<WheelSample> wheels_;
  std::optional<msckf::KnownSpeed> known_speed_, wheel_speed_;
  std::optional<msckf::MovingStart> planned_;
  std::deque<msckf::SeenFrame> past_;  ///< before a start, the last seconds' pictures
  int64_t next_past_us_ = 0;
  msckf::SeenFrame watched_;  ///< before a start, newest picture that watch() took
  std::optional<msckf::KnownVelocity> by_eyes_;

  MsckfPhase phase_ = MsckfPhase::kStarting;
  MsckfScale scale_ = MsckfScale::kUnknown;
  std::string reason_;
  bool stands_ = false;
  Eigen::Vector3d begun_gyro_bias_ = Eigen::Vector3d::Zero();  ///< at the start
  int reset_counter_ = 0;
  SE3 reset_delta_;
  SE3 last_pose_;  ///< where a start goes on
  int64_t next_clone_ = 1;
  int64_t clone_us_ = 0;  ///< of the newest clone
  int64_t next_wheels_us_ = 0, next_sideslip_us_ = 0, next_planar_us_ = 0, next_zero_us_ = 0;
  int64_t stands_since_us_ = 0, zero_us_ = 0;  ///< as far as is known; last time that its velocity was taken for zero
  int64_t used_us_ = 0;                        ///< last time that points or standing corrected the state
  int64_t doubtful_us_ = 0;                    ///< since when most points are refused; zero: they are not
  double used_share_ = 1.0;
  int num_seen_ = 0;
};

}  // namespace roadfix
