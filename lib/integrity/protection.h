/// Protection levels of one stream of poses: along, across and up, beyond which an error lies with a stated
/// probability, and whether the pose may be used for what the alert limits stand for. lib/integrity/MODEL.md, (P.n.m).
///
/// Inputs in order of time; what the receiver's innovations and the witness say up to a pose's time comes before it.
/// The same inputs in the same order give the same bits. Not thread safe.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "integrity/error_scale.h"
#include "integrity/integrity_config.h"
#include "integrity/separation.h"
#include "samples/samples.h"

namespace roadfix {

/// One attempt of the estimator to use a GNSS position.
struct PositionInnovation {
  int64_t t_us = 0;
  bool accepted = false;
  double nis = 0.0;
  int dof = 0;
  Eigen::Vector3d innovation = Eigen::Vector3d::Zero();  ///< m, enu; what has no third axis leaves it zero
  Eigen::Vector3d variance = Eigen::Vector3d::Zero();    ///< m2, of it
};

/// What decided a level.
enum class Hypothesis {
  kNoFault,        ///< the covariance, its scale and tails
  kReceiver,       ///< positions may have gone wrong a moment ago
  kUnverified,     ///< positions came back, or the first ones: not yet checked against dead reckoning
  kContradiction,  ///< positions and dead reckoning, or positions and prediction, contradict each other
  kCoasting,       ///< no position; wheels or gyro may have failed
  kNoBound         ///< nothing to bound it by
};

enum Risk { kFrequent = 0, kRare = 1 };
inline constexpr int kRisks = 2;

struct Protection {
  int64_t pose_us = 0;
  std::array<Eigen::Vector3d, kRisks> level;  ///< m, along, across, up; infinite where there is no bound
  Hypothesis hypothesis = Hypothesis::kNoBound;
  bool usable = false;       ///< the rare levels are within the alert limits
  std::string reason;        ///< plain words; empty where it is usable
  double since_check = 0.0;  ///< s, since positions last passed the checks against dead reckoning and prediction
};

class ProtectionMonitor {
 public:
  explicit ProtectionMonitor(const IntegrityConfig& config);

  void add(const PositionInnovation& innovation);
  /// Dead reckoning that takes no positions; `jumps` differs where it began anew.
  void add_witness(const Odometry& pose, int64_t jumps) { separation_.add_witness(pose, jumps); }
  /// Time of the anchor that a contradiction holds on to; nothing where there is none.
  [[nodiscard]] std::optional<int64_t> contradicted_since() const {
    return anchored_ && !returned_ ? std::optional<int64_t>(anchor_.t_us) : std::nullopt;
  }
  /// What feeds this estimate is contradicted, anchored at that time: so is this one, (P.5.4).
  void inherit_contradiction(int64_t t_us);
  /// The bound of a pose in ENU axes; an invalid one has none.
  Protection bound(const Odometry& estimate);

  template <class Self, class Archive>
  static void archive(Self& self, Archive& a) {
    SeparationMonitor::archive(self.separation_, a);
    ErrorScale::archive(self.noise_, a);
    ErrorScale::archive(self.whiteness_, a);
    a(self.fix_variance_, self.mean_innovation_, self.innovation_weight_, self.innovation_us_, self.fix_us_,
      self.refused_us_, self.failed_us_, self.first_us_, self.checked_us_, self.lever_enu_, self.lever_variance_,
      self.turning_, self.fix_way_, self.anchored_, self.returned_);
    Anchor::archive(self.anchor_, a);
    Anchor sound = self.sound_.value_or(Anchor{});
    bool known = self.sound_.has_value();
    a(known);
    Anchor::archive(sound, a);
    if constexpr (Archive::kReads) self.sound_ = known ? std::optional<Anchor>(sound) : std::nullopt;
  }

 private:
  void update_checks();
  void hold_while_coasting();
  void contradict();
  [[nodiscard]] bool coasting() const;
  [[nodiscard]] bool coasting_since(int64_t t_us) const;
  [[nodiscard]] bool biased() const;
  [[nodiscard]] bool agrees_with_anchor() const;
  void apply_no_fault(const Odometry& estimate, Protection& out) const;
  void apply_receiver(Protection& out) const;
  void apply_anchor(Protection& out) const;
  void apply_coasting(Protection& out) const;
  void raise(int risk, const Eigen::Vector3d& level, Hypothesis hypothesis, Protection& out) const;
  void turn_lever_arm(const Eigen::Matrix3d& R_frame_vehicle);
  void judge(Protection& out) const;

  IntegrityConfig config_;
  SeparationMonitor separation_;
  ErrorScale noise_;                                           ///< of position innovations
  ErrorScale whiteness_;                                       ///< of their mean over a few seconds
  Eigen::Vector3d fix_variance_ = Eigen::Vector3d::Zero();     ///< m2, enu, of the last accepted position
  Eigen::Vector3d mean_innovation_ = Eigen::Vector3d::Zero();  ///< of its own sigma, decaying
  double innovation_weight_ = 0.0;                             ///< how many it is of
  std::optional<int64_t> innovation_us_, fix_us_, refused_us_, failed_us_, first_us_, checked_us_;
  Eigen::Matrix3d lever_enu_ = Eigen::Matrix3d::Zero();       ///< m2, of the lever arm as the last positions saw it
  Eigen::Vector3d lever_variance_ = Eigen::Vector3d::Zero();  ///< m2, likewise, axes of the newest pose
  double turning_ = 0.0;  ///< m/s2, the last seconds' largest lateral acceleration, decaying
  double fix_way_ = 0.0;  ///< m, driven until the last position
  bool anchored_ = false;
  std::optional<Anchor> sound_;  ///< before positions that may have failed unnoticed, (P.4.8)
  Anchor anchor_;                ///< the pose from before positions became suspect, (P.5.n)
  bool returned_ = false;        ///< the anchor is an outage's, not a contradiction's
};

}  // namespace roadfix
