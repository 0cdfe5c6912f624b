/// One pose from GNSS/INS, vision and wheels: an IMM of two motion models (Lee et al., 2025), fed by relative motion and by what
/// absolute poses gained. Derivation: lib/fusion/MODEL.md.
///
/// Frames: enu for POSE_INS and POSE_FUSED; vo and wheel are the estimators' own level frames; local starts where the
/// fusion started. Samples come in the order of their times. The same inputs in the same order give the same bits.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "fusion/frame_tie.h"
#include "fusion/fusion_config.h"
#include "fusion/imm.h"
#include "fusion/measurement.h"
#include "geometry/euler.h"
#include "samples/samples.h"
#include "stream/state_bytes.h"

namespace roadfix {

enum class FusionChannel { kIns = 0, kVo = 1, kWheel = 2 };
inline constexpr int kFusionChannels = 3;

struct ChannelSample {
  FusionChannel channel = FusionChannel::kIns;
  Odometry odometry;  ///< covariances without what the channel's whole way has in common: without_common()
  std::optional<PlanarPassing> passing;  ///< of a vision that tells it; picture's part not in the odometry's covariance
  int reset_counter = 0;
  bool metric = true;        ///< false: lengths are up to a common factor
  bool turns_exact = false;  ///< as in CommonError
  /// A filter over the gyro that the INS uses (an MSCKF): its yaw is no second witness, and its poses take back what
  /// its whole way has had wrong, so that its velocities tell its motion.
  bool shares_imu = false;
  int64_t seq = 0;
};

enum class FuseStatus { kAccepted, kGated, kNotReady, kBadInput, kBadQuality, kReset, kDisabled };

struct FusionChannelReport {
  FuseStatus status = FuseStatus::kNotReady;
  double weight = 0.0;  ///< share of the information gained lately, [0, 1]
  double alpha = 1.0;   ///< on the channel's own covariance
  double nis = 0.0;     ///< of the last attempt
  int dof = 0;
  Eigen::Vector3d innovation = Eigen::Vector3d::Zero();           ///< the first dof count
  Eigen::Vector3d innovation_variance = Eigen::Vector3d::Zero();  ///< SI units of the innovation, squared
  double gate = 0.0;
  std::optional<int64_t> last_us;
};

struct VisionRestart {
  SE3 T_vo_vehicle;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();
  Matrix6d cov_pose = Matrix6d::Zero();
  std::string reason;
};

enum class FusionPhase { kWaiting, kRunning, kWeak, kLost };

struct FusionReport {
  FusionPhase phase = FusionPhase::kWaiting;
  Validity validity = Validity::kInvalid;  ///< of the ENU pose
  Validity local_validity = Validity::kInvalid;
  std::string reason;
  int reset_counter = 0;
  Planar last_jump = Planar::Zero();
  double last_jump_height = 0.0;  ///< m
};

class Fusion {
 public:
  explicit Fusion(const FusionConfig& config);

  /// What the INS says about GNSS: present (aided by it lately) or lost. For ramps, tie and status.
  void set_gnss(int64_t t_us, bool present);

  /// What the INS says about its gyro: standard deviation of its bias by axis, rad/s, and how the axes lie in the
  /// vehicle. Its yaw drifts with that. Never said, or zero: its yaw errors are a sum of independent steps.
  void set_ins_gyro(const Eigen::Vector3d& bias_std, const YawPitchRoll& mounting);

  /// Fuses one sample; the state moves to its time. Older samples are refused.
  FuseStatus add(const ChannelSample& sample);

  [[nodiscard]] int64_t t_us() const { return t_us_; }
  /// Motion since t_us() as a channel tells it that the fusion has not used yet.
  struct Ahead {
    double dt = 0.0;              ///< s
    double silent = 0.0;          ///< s of it in which the channel told nothing; at its end
    Planar way = Planar::Zero();  ///< in the axes of its start
    double rise = 0.0;            ///< m
    FusionChannel channel = FusionChannel::kIns;
    bool metric = true;
    const Odometry* felt = nullptr;  ///< the channel's newest pose, for its velocities and attitude
    LevelView view;                  ///< of that pose
    /// What is left to make up when the newest sample will have been used; nothing: as at t_us().
    std::optional<ReturnState> back;
  };
  struct Poses {
    Odometry fused;  ///< POSE_FUSED, enu
    Odometry local;  ///< POSE_LOCAL: never jumps
  };
  /// The poses carried forward by that motion.
  [[nodiscard]] Poses carried(const Ahead& ahead) const;
  /// The fused pose is the INS's newest, but for what is being made up.
  [[nodiscard]] bool follows(const Ahead& ahead) const;
  [[nodiscard]] const ReturnState& comeback() const { return comeback_; }
  [[nodiscard]] Odometry fused() const { return carried({}).fused; }
  [[nodiscard]] Odometry local() const { return carried({}).local; }
  [[nodiscard]] FusionReport report() const;
  [[nodiscard]] const FusionChannelReport& channel(FusionChannel c) const {
    return reports_[static_cast<std::size_t>(c)];
  }
  [[nodiscard]] const Imm& imm() const { return imm_; }
  [[nodiscard]] FusionEstimate estimate() const { return combine(imm_); }
  [[nodiscard]] const FrameTie& tie() const { return tie_; }
  [[nodiscard]] bool tie_frozen() const { return !gnss_; }
  /// Vision disagrees, or is lost, and should start again; until take_restart().
  [[nodiscard]] bool asks_restart() const { return !restart_reason_.empty(); }
  /// `here`: fused, of the time that the request is stamped with (Outlook::poses).
  [[nodiscard]] VisionRestart take_restart(const Odometry& here);
  [[nodiscard]] const FusionConfig& config() const { return config_; }

  void save(StateWriter& writer) const;
  void load(StateReader& reader);

 private:
  /// What is remembered of a channel.
  struct Memory {
    std::optional<Odometry> last;  ///< at the clone
    LevelView view;                ///< of last
    int reset_counter = 0;
    bool shares_imu = false;
    Eigen::Matrix2d velocity_covariance = Eigen::Matrix2d::Zero();  ///< m2/s2, in enu, of the INS's lasting error
    double drift_variance = 0.0;                                    ///< rad2/s2, of its yaw rate, for the INS
    int64_t drifts_since_us = 0;                                    ///< since when they last
    double yaw_rate_variance = 0.0;  ///< rad2/s, of its motion lately: which of two that share a gyro is better
    std::optional<int64_t> alive_us;
    bool carried = false;  ///< its clone has come along with its last sample
    ConsistencyCheck check;
  };

  /// The combined estimate at the last sample, as far as the local pose needs it.
  struct Before {
    PlanarMixture at;
    double dt = 0.0;              ///< s since then
    double speed_variance = 0.0;  ///< m2/s2
  };

  /// The estimate after a motion that it has not used.
  struct Forward {
    PlanarEstimate planar;
    Planar way = Planar::Zero();  ///< without the velocity's error: an estimate of it that changes would be a jump
    double speed = 0.0;
    double speed_variance = 0.0;
    double turn = 0.0;
  };

  [[nodiscard]] Forward forward(const Ahead& ahead) const;
  template <class Self, class Visitor>
  static void visit_members(Self& self, const Visitor& visitor);

  [[nodiscard]] Memory& memory(FusionChannel c) { return memories_[static_cast<std::size_t>(c)]; }
  [[nodiscard]] const Memory& memory(FusionChannel c) const { return memories_[static_cast<std::size_t>(c)]; }
  [[nodiscard]] bool alive_at(FusionChannel c, int64_t t_us) const;
  [[nodiscard]] bool alive(FusionChannel c) const { return alive_at(c, t_us_); }
  [[nodiscard]] double timeout(FusionChannel c) const;
  [[nodiscard]] const MotionFloor& floor(FusionChannel c) const;
  [[nodiscard]] static ChannelSlots slots(FusionChannel c);

  void start(const ChannelSample& sample);
  void place(const Odometry& o);
  void advance(int64_t t_us, bool motion_of_ins);
  FuseStatus fuse(const ChannelSample& sample, const LevelView& view, const Before& before,
                  FusionChannelReport& report);
  FuseStatus fuse_literal(const ChannelSample& sample, FusionChannelReport& report);
  FuseStatus fuse_motion(const ChannelSample& sample, const LevelView& view, FusionChannelReport& report);
  [[nodiscard]] Planar motion_of(FusionChannel channel, const LevelView& last, const LevelView& now) const;
  [[nodiscard]] bool scale_is_open(const ChannelSample& sample, const Planar& motion);
  void hear_of_turns(bool exact);
  void follow_ins_errors(const Odometry& ins, double dt, bool was_away);
  /// m2/s2, east and north, by which the INS's velocity, with covariance P, is unsurer than what lasts of its error.
  [[nodiscard]] Eigen::Vector2d grown_velocity_variance(const Eigen::Matrix2d& P) const;
  [[nodiscard]] Eigen::Matrix3d motion_noise(const Memory& m, const ChannelSample& sample, const LevelView& view,
                                             const Planar& motion, double dt) const;
  FuseStatus carry_by_ins(const Planar& motion, double dt, const Eigen::Matrix3d& R, bool with_yaw,
                          FusionChannelReport& report);
  FuseStatus fuse_odometry(const ChannelSample& sample, const Planar& motion, double dt, const Eigen::Matrix3d& R,
                           bool with_yaw, FusionChannelReport& report);
  [[nodiscard]] PlanarPassing passing(const ChannelSample& sample) const;
  void fuse_rates(const ChannelSample& sample, const LevelView& view, bool told);
  FuseStatus fuse_gain(const ChannelSample& sample, const LevelView& view, const PlanarEstimate& known,
                       FusionChannelReport& report);
  FuseStatus follow_ins(const PlanarEstimate& known, const LevelView& view, FusionChannelReport& report);
  void count_fix(const Planar& correction);
  [[nodiscard]] bool vision_speaks() const;
  void apply_gain(const FusionMeasurement<3>& gain);
  void distrust_velocity(const Planar& difference);
  void give_way(const Planar& difference);
  void remember(const ChannelSample& sample, const LevelView& view);
  void move_height(const ChannelSample& sample, const LevelView& view);
  void gain_height(const Odometry& o);
  void follow_local(const Before& before, const PlanarMixture& now, bool told);
  [[nodiscard]] Eigen::Vector3d leading_velocity() const;
  void update_tie(const ChannelSample& sample);
  void ask_restart(const char* reason);
  void weigh(FusionChannel c, double information);
  [[nodiscard]] bool better_yaw_elsewhere(const ChannelSample& sample, double yaw_rate_variance) const;
  /// What the modes' innovations were, in the mean.
  template <int M>
  struct Mean {
    FusionInnovation<M> innovation;
    Eigen::Matrix<double, M, 1> difference = Eigen::Matrix<double, M, 1>::Zero();
  };
  template <int M>
  static void add(Mean<M>& mean, double share, const FusionInnovation<M>& innovation,
                  const Eigen::Matrix<double, M, 1>& difference);
  template <int M, class At>
  Mean<M> update(const At& at);  ///< at(x): the measurement linearised there
  static void tell(const FusionInnovation<3>& innovation, const Eigen::Vector3d& difference,
                   FusionChannelReport& report);

  FusionConfig config_;
  bool started_ = false;
  bool placed_ = false;  ///< the planar state is in enu
  int64_t t_us_ = 0;
  Imm imm_;
  PlanarMixture now_;  ///< of imm_
  PosesBefore begun_;  ///< where the modes began this step, while the INS's clone is the pose itself
  std::array<Memory, kFusionChannels> memories_;
  std::array<FusionChannelReport, kFusionChannels> reports_;
  std::array<double, kFusionChannels> information_{};
  double height_ = 0.0;           ///< m
  double height_variance_ = 1.0;  ///< m2
  int64_t height_us_ = 0;         ///< until when somebody told it
  Odometry attitude_;             ///< newest roll and pitch, with their covariance
  bool gnss_ = false;
  double ins_drift_std_ = 0.0;  ///< rad/s
  DropoutRamp ramp_;
  FrameTie tie_;
  AgreementState agreement_;
  std::string restart_reason_;  ///< of a request that nobody took yet; else empty
  std::optional<int64_t> restart_us_;
  std::optional<int64_t> refused_since_us_;
  std::optional<int64_t> last_fix_us_;
  bool foreign_ = false;           ///< something in the pose did not come through the INS
  bool ins_corrected_ = false;     ///< the INS used a fix since its last sample
  int passes_needed_ = 0;          ///< fixes that must pass the gate before absolute poses are used again
  Planar doubt_ = Planar::Zero();  ///< by which vision contradicted when the fusion gave way, fading
  double distrust_ = 0.0;          ///< m/s, of the INS velocity after a contradiction
  std::optional<int64_t> last_tie_us_;
  bool vo_scale_open_ = true;  ///< a non-metric vision's scale has no value yet
  bool vo_turns_exact_ = false;
  ReturnState comeback_;
  PlanarEstimate local_;
  LastingVelocity lasting_;  ///< of the local pose
  double untold_ = 0.0;      ///< s since somebody told the motion; then the poses were:
  struct {
    PlanarEstimate local, fused;
    Planar driven = Planar::Zero();  ///< since, as the speed says
    double speed_variance = 0.0;
  } told_;
  double local_height_ = 0.0;
  double local_height_variance_ = 0.0;
};

}  // namespace roadfix
