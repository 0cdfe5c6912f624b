/// The navigation filter: one error state and one covariance for GNSS, imu, wheels and camera. Derivation:
/// lib/navigation/MODEL.md.
///
/// Frames: level is enu at the first good fix (or at the remembered place), or local where no fix has come: it becomes enu,
/// with a reset, when fixes tell how it lies in it. imu axes x forward, y left, z up; vehicle
/// axes differ from the imu's by the mounting angles.
/// Time: inputs come in the order of their stamps as the caller's horizon passes them (advance, add); see() hands in
/// the newest imu sample ahead of the horizon, and output() is for that one. The state stays behind the horizon by the
/// longest latency that is possible yet, so that every measurement is used at its own moment.
/// Without an imu the car's own motion drives the state (motion/car_motion.h): see() of wheel samples, or of the time
/// alone, and add() take the place of see() and advance() of imu samples, and imu axes are the vehicle's. It begins so
/// where see() is called before the first imu sample; with that one it begins again.
/// Guarantees: same inputs in the same order give the same bits; no allocation once aligned; one thread.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "navigation/aiding/aiding.h"
#include "navigation/aiding/camera/camera_control.h"
#include "navigation/aiding/gnss_screen.h"
#include "navigation/initialisation/alignment.h"
#include "navigation/initialisation/frame_tie.h"
#include "navigation/initialisation/local_start.h"
#include "navigation/initialisation/moving_start.h"
#include "navigation/motion/car_motion.h"
#include "navigation/output_predictor.h"

namespace roadfix::navigation {

enum class InputStatus { kAccepted, kBadInput, kOutOfOrder };

struct NavigationStatus {
  Phase phase = Phase::kWaiting;
  std::string waits_for;  ///< plain words; empty once aligned
  int aided_by = 0;       ///< bit i: AidingSource i used within its last coasting time
  bool coasting = false;
  int64_t coasting_since_us = 0;
  GnssQuality gnss_quality = GnssQuality::kAbsent;
  std::string gnss_reason;
  int64_t bad_imu_samples = 0;
  bool imu_frozen = false;
  int64_t imu_gaps = 0;
  int64_t wheel_scale_steps = 0;  ///< that were detected and taken back
};

struct NavigationOutput {
  Phase phase = Phase::kWaiting;
  bool local = false;  ///< the level frame is where it started, until fixes tie it; else enu
  Odometry odometry;   ///< imu origin and axes in the level frame
  std::string reason;  ///< plain words, empty when all is well
  int reset_counter = 0;
  SE3 reset_delta;  ///< of the last jump: p new minus old; q_old^-1 q_new
};

class Navigation {
 public:
  explicit Navigation(const NavigationConfig& config);

  InputStatus see(const ImuSample& imu);       ///< newest sample, ahead of the horizon
  InputStatus advance(const ImuSample& imu);   ///< the horizon has passed this sample
  InputStatus see(const WheelSample& wheels);  ///< newest sample, where no imu is; the first must have a yaw rate
  InputStatus see(int64_t t_us);               ///< newest time, where such wheels have fallen silent
  [[nodiscard]] bool has_imu() const { return config_.facts.has_imu; }
  void add(const GnssFix& fix, int64_t id = 0);
  void add(const WheelSample& wheels, int64_t id = 0);
  void add(const MagSample& mag, int64_t id = 0);
  void add(const TrackPicture& picture, int64_t id = 0);

  /// Nothing before the first fix, and in a local frame.
  [[nodiscard]] std::optional<Geodetic> anchor() const { return anchor_; }
  /// What an earlier drive left, before the first start of this one; later it changes nothing.
  void recall(const Memory& memory);
  /// What this drive leaves to the next; nothing until aligned.
  [[nodiscard]] std::optional<Memory> memory() const;

  [[nodiscard]] NavigationOutput output();
  [[nodiscard]] NavigationStatus status() const;
  /// Filter in use (the leading hypothesis while aligning); nothing before alignment starts.
  [[nodiscard]] const Filter* filter() const;
  /// Nothing where no camera is used.
  [[nodiscard]] const CameraControl* camera() const { return camera_ ? &*camera_ : nullptr; }
  /// What was tried since the last call to clear_records().
  [[nodiscard]] const std::vector<AidingRecord>& records() const { return records_; }
  void clear_records() { records_.clear(); }

  /// Everything that later outputs depend on; load() throws std::runtime_error on bytes that are no such state.
  [[nodiscard]] std::vector<uint8_t> save() const;
  void load(std::span<const uint8_t> bytes);

 private:
  Navigation(const NavigationConfig& config, bool has_imu);
  [[nodiscard]] bool goes_without_imu();
  void change_motion(bool has_imu);
  void advance_to(int64_t t_us);
  void take(const GnssFix& fix, int64_t id);
  void take(const WheelSample& wheels, int64_t id);
  void step(const ImuSample& imu);
  void step_aligned(const ImuSample& imu, bool block_done);
  void step_heading(const ImuSample& imu, double dt, bool block_done);
  void use(const Queued& q);
  void use_pictures(int64_t t_us);
  void mend_steps();
  void align_again();
  void ask_heading();
  void try_local_start(int64_t t_us, bool block_done);
  void begin_locally(int64_t t_us, AidingSource by);
  void try_moving_start(int64_t t_us);
  [[nodiscard]] bool may_start_locally(int64_t t_us) const;
  [[nodiscard]] bool gives_way_to_fixes(int64_t t_us) const;
  /// A measurement of a receiver in a local frame; true: the frame is enu now, and it can be used.
  bool tie_frame(const Queued& q);
  void end_alignment();
  void begin_running();
  void note(AidingRecord record, int64_t id = 0);
  void forget_before(int64_t t_us);
  [[nodiscard]] inertial::ImuNoise noise_over(int64_t t_us, double dt) const;
  [[nodiscard]] bool standing(const Filter& filter, bool block_done) const;
  [[nodiscard]] bool picture_still(const Mean& x) const;
  bool heads_backwards();
  [[nodiscard]] bool started_wrong() const;
  [[nodiscard]] bool lost_locally() const;
  [[nodiscard]] bool usable() const;
  /// No GNSS is to be used: the frame stays local.
  [[nodiscard]] bool without_gnss() const {
    const SourceList& s = config_.sources;
    return !s.gnss_position && !s.gnss_velocity && !s.gnss_heading;
  }
  [[nodiscard]] std::optional<int64_t> coasting_since() const;
  /// s without aiding that are no coasting yet: a receiver that gives a fix every five seconds is not silent for those.
  [[nodiscard]] double coasting_time() const;
  [[nodiscard]] bool moved_meanwhile(double dt) const;
  void count_reset(const SE3& before, const Mean& after);
  void rebase_predictor();
  template <class Archive>
  void serialise(Archive& a);

  NavigationConfig given_, config_;  ///< the second as it is used, with or without an imu
  Aiding aiding_;
  GnssScreen screen_;
  inertial::ImuNoiseEstimator imu_noise_;
  inertial::StandstillDetector standstill_;
  CarMotion car_;
  inertial::ImuRing ring_;
  MeasurementQueue queue_;
  Alignment alignment_;
  LocalStart local_start_;
  MovingStart moving_start_;
  FrameTie tie_;
  std::optional<Geodetic> anchor_;
  std::optional<Geodetic> tie_anchor_;  ///< of the fixes that come in a local frame
  bool local_ = false;                  ///< the level frame is local
  std::optional<Filter> filter_;
  std::optional<CameraControl> camera_;  ///< where there is one that is to be used
  std::optional<OutputPredictor> predictor_;
  Phase phase_ = Phase::kWaiting;
  bool predictor_stale_ = true;
  int64_t lag_us_ = 0, last_step_us_ = 0;
  int64_t last_wheel_us_ = 0, wheels_at_us_ = 0, last_magnetic_us_ = 0, last_fix_us_ = 0;
  Geodetic last_fix_;
  std::array<int64_t, kAidingSources> used_at_us_{};
  std::optional<SE3> abandoned_;  // last pose of a filter that was given up
  int reset_counter_ = 0;
  SE3 reset_delta_;
  int64_t bad_imu_ = 0, gaps_ = 0, steps_ = 0;
  bool arm_contradicted_ = false;                         ///< the antenna is not where the calibration says
  int64_t backwards_since_us_ = 0;                        ///< faster than a car goes in reverse
  bool start_agreed_ = true;                              ///< fixes have, over some way
  Eigen::Vector3d started_at_ = Eigen::Vector3d::Zero();  ///< m, level
  std::vector<AidingRecord> records_;
};

}  // namespace roadfix::navigation
