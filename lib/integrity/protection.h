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

#include "integrity/integrity_config.h"
#include "integrity/position_innovations.h"
#include "integrity/separation.h"
#include "integrity/suspicion.h"
#include "integrity/unclaimed_errors.h"
#include "samples/samples.h"

namespace roadfix {

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
    return suspicion_.of_contradiction() ? std::optional<int64_t>(suspicion_.anchor().t_us) : std::nullopt;
  }
  /// What feeds this estimate is contradicted, anchored at that time: so is this one, (P.5.4).
  void inherit_contradiction(int64_t t_us);
  /// The bound of a pose in ENU axes; an invalid one has none.
  Protection bound(const Odometry& estimate);

  template <class Self, class Archive>
  static void archive(Self& self, Archive& a) {
    SeparationMonitor::archive(self.separation_, a);
    PositionInnovations::archive(self.positions_, a);
    Suspicion::archive(self.suspicion_, a);
    UnclaimedErrors::archive(self.unclaimed_, a);
    Anchor::archive_optional(self.sound_, a);
    a(self.first_us_, self.checked_us_, self.fix_way_);
  }

 private:
  void update_checks();
  void contradict();
  [[nodiscard]] bool coasting() const;
  [[nodiscard]] bool coasting_since(int64_t t_us) const;
  [[nodiscard]] Anchor before(double lag) const;
  [[nodiscard]] bool agrees_with_anchor() const;
  void apply_no_fault(const Odometry& estimate, Protection& out) const;
  void apply_receiver(Protection& out) const;
  void apply_anchor(Protection& out) const;
  void apply_coasting(Protection& out) const;
  void raise(int risk, const Eigen::Vector3d& level, Hypothesis hypothesis, Protection& out) const;
  void judge(Protection& out) const;

  IntegrityConfig config_;
  SeparationMonitor separation_;
  PositionInnovations positions_;
  Suspicion suspicion_;
  UnclaimedErrors unclaimed_;
  std::optional<Anchor> sound_;  ///< before positions that may have failed unnoticed, (P.4.8)
  std::optional<int64_t> first_us_, checked_us_;
  double fix_way_ = 0.0;  ///< m, driven until the last position
};

}  // namespace roadfix
