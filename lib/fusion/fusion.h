/// One pose out of GNSS/INS, vision and wheels that is there whatever failed. Derivation: lib/fusion/MODEL.md.
///
/// POSE_FUSED is the INS's pose while that is healthy; where it is silent, invalid, frozen, jumps or contradicts two
/// witnesses, the best witness's motion carries it on from the last pose that was trusted. POSE_LOCAL is motion alone and
/// never jumps. Nothing dependent is added, so that nothing counts twice. An IMM of two motion models (Lee et al., 2025)
/// says whether the vehicle turns, and predicts where no channel is fresh.
///
/// Frames: enu once an INS has given a pose there, before that its own or POSE_LOCAL's. Samples come in the order of
/// their times. The same inputs in the same order give the same bits.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "fusion/pose_output.h"
#include "fusion/vision_restart.h"
#include "fusion/witnesses.h"

namespace roadfix {

/// Of the last sample of a channel: what AIDING_FUSION says.
struct FusionChannelReport {
  FuseStatus status = FuseStatus::kNotReady;
  double nis = 0.0;  ///< of the last comparison with the first witness there is
  int dof = 0;
  Eigen::Vector3d innovation = Eigen::Vector3d::Zero();
  Eigen::Vector3d innovation_variance = Eigen::Vector3d::Zero();
  double weight = 0.0;  ///< share of the reliability, [0, 1]
  template <class Self, class Visitor>
  static void visit_members(Self& self, const Visitor& visit) {
    visit(self.status, self.nis, self.dof, self.innovation, self.innovation_variance, self.weight);
  }
};

class Fusion {
 public:
  explicit Fusion(const FusionConfig& config);

  /// Whether fixes aid the INS now.
  void set_gnss(int64_t t_us, bool present);

  /// Takes in one sample; the state moves to its time.
  FuseStatus add(const ChannelSample& sample);

  /// Both poses for now: at the time of `newest`, or at t_us() where that is not ahead. Counts jumps of the published pose.
  FusedPoses publish(const NewestSample& newest) { return output_.publish(now(), started_, newest); }

  [[nodiscard]] int64_t t_us() const { return t_us_; }
  [[nodiscard]] const Imm& imm() const { return local_.imm(); }
  [[nodiscard]] const LocalMotion& local_motion() const { return local_; }
  [[nodiscard]] const Failover& failover() const { return failover_; }
  /// POSE_LOCAL from above at a time near t_us().
  [[nodiscard]] Planar local_planar(int64_t t_us) const { return local_.planar(channels_, t_us); }
  /// A sample of the past, its pose carried on to t_us() by POSE_LOCAL's motion.
  [[nodiscard]] ChannelSample at_present(ChannelSample sample) const;
  /// In plain words, what keeps POSE_FUSED from being the INS's pose with fixes; empty where nothing does.
  [[nodiscard]] std::string reason() const { return output_.reason(now()); }
  [[nodiscard]] const PoseChannel& channel(FusionChannel c) const { return channels_[static_cast<std::size_t>(c)]; }
  [[nodiscard]] const FusionChannelReport& channel_report(FusionChannel c) const {
    return reports_[static_cast<std::size_t>(c)];
  }
  [[nodiscard]] WitnessAgreement agreement(FusionChannel a, FusionChannel b) const {
    return witnesses_.agreement(a, b);
  }
  [[nodiscard]] const FusionConfig& config() const { return config_; }

  /// Vision is lost or contradicts, and should start again; until take_restart().
  [[nodiscard]] bool asks_restart() const { return restart_.asked(); }
  /// `local`: POSE_LOCAL for the time that the request is stamped with.
  [[nodiscard]] VisionRestart take_restart(const Odometry& local);

  void save(StateWriter& writer) const;
  void load(StateReader& reader);
  template <class Self, class Visitor>
  static void visit_members(Self& self, const Visitor& visit) {
    visit(self.channels_, self.witnesses_, self.local_, self.failover_, self.restart_, self.output_, self.reports_,
          self.t_us_, self.started_, self.epochs_, self.vision_bad_since_us_);
  }

 private:
  [[nodiscard]] PoseChannel& at(FusionChannel c) { return channels_[static_cast<std::size_t>(c)]; }

  void epoch(const ChannelSample& sample);
  [[nodiscard]] Epoch epoch_at(int64_t at_us) const;
  void judge();
  void calibrate();
  void learn(FusionChannel c);
  void learn_turns();
  void adapt(FusionChannel c, FusionChannel reference);
  void watch_frozen();
  void watch_vision(const ChannelSample& sample);
  void record(FusionChannel c, FuseStatus status);
  void weigh();
  [[nodiscard]] FusionNow now() const { return {config_, channels_, local_, failover_, t_us_}; }

  FusionConfig config_;
  Channels channels_;
  Witnesses witnesses_;
  LocalMotion local_;
  Failover failover_;
  VisionRestartRequest restart_;
  PoseOutput output_;
  std::array<FusionChannelReport, kFusionChannels> reports_;
  int64_t t_us_ = 0;
  bool started_ = false;
  int epochs_ = 0;  ///< since the calibration last learnt
  std::optional<int64_t> vision_bad_since_us_;
};

}  // namespace roadfix
