/// GNSS/INS estimator: alignment, error-state filter, aiding, gates and recovery. Derivation: lib/gnss_ins/MODEL.md.
///
/// Time: inputs come in the order of their stamps as the caller's horizon passes them (advance, add); see() hands in
/// the newest IMU sample ahead of the horizon, and output() is for that one. The state itself stays behind the horizon
/// by the longest latency that the calibration allows, so that every measurement is used at its own moment.
/// Guarantees: same inputs in the same order give the same bits; no allocation after the first fix; one thread.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "gnss_ins/apply_aiding.h"
#include "gnss_ins/error_correlation.h"
#include "gnss_ins/gnss_screen.h"
#include "gnss_ins/heading_bank.h"
#include "gnss_ins/imu_doubt.h"
#include "gnss_ins/imu_ring.h"
#include "gnss_ins/jump_judge.h"
#include "gnss_ins/refused_wheels.h"

namespace roadfix {

enum class InputStatus { kAccepted, kBadInput, kOutOfOrder };
enum class AlignmentPhase { kWaiting, kLevelling, kHeading, kDone };

struct GnssInsStatus {
  AlignmentPhase phase = AlignmentPhase::kWaiting;
  std::string waits_for;  ///< plain words; empty once aligned
  int aided_by = 0;       ///< bit i: AidingSource i used within its last coasting time
  bool coasting = false;
  int64_t coasting_since_us = 0;
  GnssQuality gnss_quality = GnssQuality::kAbsent;
  std::string gnss_reason;
  int64_t bad_imu_samples = 0;
  bool imu_frozen = false;
  int64_t imu_gaps = 0;
  int64_t wheel_scale_steps = 0;  ///< taken back, (M.50), (M.51)
};

struct GnssInsOutput {
  AlignmentPhase phase = AlignmentPhase::kWaiting;
  Odometry odometry;   ///< imu origin and axes in the anchor's enu
  std::string reason;  ///< plain words, empty when all is well
  int reset_counter = 0;
  /// Of the last jump: p new minus old in enu; q_old^-1 q_new. Where the filter was aligned again, from the last pose
  /// of the old one to the first of the new: the way driven between is in it.
  SE3 reset_delta;
};

class GnssIns {
 public:
  explicit GnssIns(const GnssInsConfig& config);

  InputStatus see(const ImuSample& imu);      ///< newest sample, ahead of the horizon
  InputStatus advance(const ImuSample& imu);  ///< the horizon has passed this sample
  void add(const GnssFix& fix, int64_t id = 0);
  void add(const WheelSample& wheels, int64_t id = 0);
  void add(const MagSample& mag, int64_t id = 0);

  /// Nothing before the first fix.
  [[nodiscard]] std::optional<Geodetic> anchor() const { return anchor_; }
  /// What an earlier drive left, before the first start of this one; later it changes nothing.
  void recall(const InsMemory& memory);
  /// What this drive leaves to the next; nothing until aligned.
  [[nodiscard]] std::optional<InsMemory> memory() const;

  [[nodiscard]] GnssInsOutput output();
  [[nodiscard]] GnssInsStatus status() const;
  /// Filter in use (the leading hypothesis while aligning); nothing before alignment starts.
  [[nodiscard]] const InsCore* core() const;
  /// What was tried since the last call to clear_records().
  [[nodiscard]] const std::vector<AidingRecord>& records() const { return records_; }
  void clear_records() { records_.clear(); }

  /// Everything that later outputs depend on; load() throws std::runtime_error on bytes that are no such state.
  [[nodiscard]] std::vector<uint8_t> save() const;
  void load(std::span<const uint8_t> bytes);

 private:
  static constexpr double kOutage = 3.0;  // s without a position, after which a receiver may come back displaced

  void step(const ImuSample& imu);
  void step_aligned(const ImuSample& imu, bool block_done);
  void step_heading(const ImuSample& imu, double dt, const ImuNoise& noise, bool block_done);
  void try_start(const ImuSample& imu);
  void try_parked(const ImuSample& imu);
  [[nodiscard]] bool stands_as_parked(const ImuBlock& block) const;
  void begin(StartState start);
  bool standing_now(const InsCore& core) const;
  bool due(int64_t& next_us, int64_t t_us, double interval) const;
  void use(const Pending& p);
  void use_wheels(const Pending& p, AidingRecord& r);
  void use_position(const Pending& measured);
  void tell_imu_doubt(const Pending& velocity, const AidingRecord& r);
  void add_up(int64_t t_us, const Eigen::Vector3d& place, const Eigen::Vector3d& velocity);
  void doubt_imu(const Pending& p, const Eigen::Vector3d& off);
  [[nodiscard]] bool returns(FixType type) const;
  void show_anew();
  void weigh(Pending& p) const;
  [[nodiscard]] static Eigen::Vector3d return_sigmas(double level);
  void begin_return(const Pending& p);
  [[nodiscard]] LastingShare lasting_of(FixType type) const;
  AidingRecord try_position(const Pending& p, const LastingShare& lasting);
  void watch_lasting(const Pending& measured, const Pending& p, const Eigen::Vector3d& before);
  void weigh_by_itself(const Pending& measured, NoiseScale& noise);
  /// While coasting: when position or zero velocity was last used.
  [[nodiscard]] std::optional<int64_t> coasting_since() const;
  /// Aligned, or the heading is known as well as the mounting lets it be seen, (M.43).
  [[nodiscard]] bool usable() const;
  void count_new_alignment();
  [[nodiscard]] bool agrees_with(AidingSource source, int64_t t_us) const;
  void recover(const Pending& p);
  void refuse_height(const Pending& p);
  void align_again();
  [[nodiscard]] bool moved_meanwhile(double dt) const;
  [[nodiscard]] ImuNoise noise_over(double dt) const;
  void remember(const GnssFix& fix);
  void note(AidingRecord record, int64_t id);
  void forget_before(int64_t t_us);
  void rebase_forward();
  template <class Archive>
  void serialise(Archive& a);

  GnssInsConfig config_;
  AidingApplier applier_;
  Gates gates_, no_gates_, no_use_;                  // as configured; that pass all; that pass nothing
  std::array<PositionQuality, 6> position_quality_;  // by FixType
  LastingWatch lasting_watch_;
  NoiseScale velocity_noise_;
  ImuMonitor monitor_;
  GnssScreen screen_;
  ImuRing ring_;
  PendingQueue pending_;
  HeadingBank bank_;
  std::optional<Geodetic> anchor_;
  std::optional<EnuAnchor> enu_;
  std::optional<InsCore> core_, forward_;
  AlignmentPhase phase_ = AlignmentPhase::kWaiting;

  int64_t lag_us_ = 0;
  int64_t last_step_us_ = 0;  // stamp of the last sample used
  int64_t forward_to_ = 0;    // ring index up to which forward_ went
  bool forward_stale_ = true;
  int64_t cov_at_us_ = 0;  // epoch of the cached output covariance
  Matrix6d cov_pose_ = Matrix6d::Zero();
  Eigen::Matrix3d cov_velocity_ = Eigen::Matrix3d::Zero();
  int64_t next_sideslip_us_ = 0, next_heave_us_ = 0;
  int64_t last_mag_us_ = 0, last_wheel_us_ = 0, wheels_at_us_ = 0;
  std::optional<InsMemory> recalled_;
  int64_t first_step_us_ = 0;
  bool unseen_ = false;                      // started where it was parked, and no position has agreed yet
  std::optional<GnssFix> fix_, fix_before_;  // good ones, for the start
  int64_t last_fix_us_ = 0;                  // the last one that passed, to know it when it comes again
  int64_t resumed_us_ = 0;                   // the first one after the receiver was last silent for an outage
  Geodetic last_fix_;
  int64_t told_us_ = 0;  // the last fix with a velocity: its stamp, place and velocity
  Eigen::Vector3d told_place_ = Eigen::Vector3d::Zero(), told_velocity_ = Eigen::Vector3d::Zero();
  int64_t told_since_us_ = 0;                                // since when each fix had one,
  Eigen::Vector3d contradiction_ = Eigen::Vector3d::Zero();  // and what they add up to besides the positions
  ImuDoubt imu_doubt_;
  std::optional<double> wheel_speed_;
  std::array<int64_t, kAidingSources> used_at_us_{};
  int64_t refused_since_us_ = 0;
  int refused_ = 0;
  JumpJudge jump_;
  RefusedWheels refused_wheels_;
  int64_t agreed_since_us_ = 0;  // first position taken since the last start or recovery
  int64_t recovered_at_us_ = 0;
  int64_t height_refused_since_us_ = 0;  // 0: the last position agreed in height as well
  int64_t position_at_us_ = 0;           // stamp of the last position tried
  double fix_interval_ = 1.0;            // s, between the last two that came without an outage
  std::optional<SE3> abandoned_;         // last pose of a filter that was given up
  bool lost_ = false;                    // to be aligned again
  int reset_counter_ = 0;
  SE3 reset_delta_;
  int64_t bad_imu_ = 0, gaps_ = 0, wheel_scale_steps_ = 0;
  std::vector<AidingRecord> records_;
};

}  // namespace roadfix
