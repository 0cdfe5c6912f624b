/// Lee et al. (2025) as printed: two estimators' poses are independent pseudo-measurements (5), (6) of an IMM of constant
/// acceleration and constant turn, with covariances that are scaled, clipped and ramped by each sensor's reliability
/// (MODEL.md, section 3). A baseline: the poses are not independent, and its covariance is too small for that.
///
/// Each part has a switch, so that the paper's ablation can be run. Their visual frame was tied to the reference; here it is
/// tied online to the fused pose while GNSS is there.
#pragma once

#include <array>

#include "fusion/fusion.h"
#include "papers/adaptive_covariance.h"
#include "papers/frame_tie.h"

namespace roadfix {

struct LiteralConfig {
  bool scale = true;         ///< alpha on the channels' covariances, section 3.2.2 of the paper
  bool clip = true;          ///< of the standard deviations to [R_min, R_max]
  bool ramp = true;          ///< of alpha_vio in an outage and after it; without: a step
  bool gate = true;          ///< Mahalanobis gate
  bool gnss_first = true;    ///< order of correction at one time; otherwise VIO first
  bool fixed_noise = false;  ///< R of each channel is what it was at its first use: the paper's ablation
  bool one_model = false;    ///< CT alone: likewise
  int gate_recovers =
      10;  ///< poses of a channel refused in a row, after which the next one is used: its covariance is the gate's
  AdaptiveConfig adaptive;
  TieNoise tie;
};

template <class Visitor>
void visit(LiteralConfig& c, Visitor& v) {
  v.boolean("scale", c.scale);
  v.boolean("clip", c.clip);
  v.boolean("ramp", c.ramp);
  v.boolean("gate", c.gate);
  v.boolean("gnss_first", c.gnss_first);
  v.boolean("fixed_noise", c.fixed_noise);
  v.boolean("one_model", c.one_model);
  v.integer("gate_recovers", c.gate_recovers, 1, 100000);
  v.group("adaptive", c.adaptive);
  v.group("tie", c.tie);
}

class LiteralFusion {
 public:
  LiteralFusion(const LiteralConfig& config, const MotionNoise& motion, const ModeDurations& durations);

  void set_gnss(int64_t t_us, bool present);
  /// A pose of GNSS/INS in ENU, or of vision in its own frame; wheels are not of the scheme.
  FuseStatus add(const ChannelSample& sample);

  [[nodiscard]] bool started() const { return started_; }
  [[nodiscard]] int64_t t_us() const { return t_us_; }
  /// Height, roll and pitch are the INS's; velocity along the vehicle's x and yaw rate the mixture's.
  [[nodiscard]] Odometry fused() const;
  /// The same carried on to the time of `local` by the motion of POSE_LOCAL since; nothing before the start.
  [[nodiscard]] std::optional<Odometry> carried(const Fusion& fusion, const Odometry& local) const;
  [[nodiscard]] bool gnss() const { return gnss_; }
  /// Poses that were refused so long that the next one was used.
  [[nodiscard]] int resets() const { return resets_; }
  [[nodiscard]] const Imm& imm() const { return imm_; }
  [[nodiscard]] const FrameTie& tie() const { return tie_; }
  struct ChannelReport {
    FuseStatus status = FuseStatus::kNotReady;
    double alpha = 1.0;
    PoseInnovation innovation;
  };
  [[nodiscard]] const ChannelReport& report(FusionChannel c) const { return reports_[static_cast<std::size_t>(c)]; }

  void save(StateWriter& writer) const;
  void load(StateReader& reader);

 private:
  struct Memory {
    ConsistencyCheck check;
    Eigen::Matrix3d first = Eigen::Matrix3d::Zero();  ///< R of its first use, of fixed_noise
    bool used = false;
    int refused = 0;  ///< in a row
  };
  void start(const Odometry& ins);
  FuseStatus take(const ChannelSample& sample);
  FuseStatus use(const ChannelSample& sample);
  [[nodiscard]] double alpha(FusionChannel c) const;
  [[nodiscard]] Eigen::Matrix3d noise(Memory& memory, const Eigen::Matrix3d& P, double alpha) const;
  FuseStatus correct(FusionChannel c, const Odometry& enu);
  void follow_tie(const Odometry& vision);

  template <class Self, class Visitor>
  static void visit_members(Self& self, const Visitor& visit);

  LiteralConfig config_;
  MotionNoise motion_;
  ModeDurations durations_;
  Imm imm_;
  FrameTie tie_;
  DropoutRamp ramp_;
  std::array<Memory, 2> memories_;  ///< INS, vision
  std::array<ChannelReport, kFusionChannels> reports_;
  Odometry attitude_;  ///< newest of the INS
  std::optional<int64_t> last_tie_us_;
  std::optional<ChannelSample> waiting_;  ///< of the INS, where vision comes first
  int64_t t_us_ = 0;
  int resets_ = 0;
  bool started_ = false;
  bool gnss_ = false;
};

}  // namespace roadfix
