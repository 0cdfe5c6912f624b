/// POSE_LOCAL: the vehicle's motion since the start by the channel that gives it best, without a jump; and the IMM, which
/// says whether the vehicle turns and how its speed changes (MODEL.md, sections 2 and 6).
#pragma once

#include <optional>

#include "fusion/carried_pose.h"
#include "fusion/imm.h"

namespace roadfix {

class LocalMotion {
 public:
  explicit LocalMotion(const FusionConfig& config) : config_(config) {}

  void start(int64_t t_us);
  /// After `channels` took in a sample of channel `c`, a valid one if `fresh`: chooses who leads and goes on by it.
  void add(FusionChannel c, bool fresh, const Channels& channels, int64_t t_us);

  /// Whose motion leads; nothing where no channel is relied on.
  [[nodiscard]] std::optional<FusionChannel> leader() const { return leader_; }
  /// The best witness beside the INS.
  [[nodiscard]] std::optional<FusionChannel> witness(const Channels& channels, int64_t t_us) const;
  /// s since a channel gave the motion.
  [[nodiscard]] double unled(int64_t t_us) const { return seconds_between(led_us_, t_us); }
  [[nodiscard]] const CarriedPose& pose() const { return pose_; }
  [[nodiscard]] const Imm& imm() const { return imm_; }

  /// Motion between two times by the best velocity there is, changed as the IMM's acceleration has it.
  [[nodiscard]] MotionStep motion(const Channels& channels, int64_t from_us, int64_t to_us) const;
  /// POSE_LOCAL at a time near pose().t_us(), before it as well: from above, and whole.
  [[nodiscard]] Planar planar(const Channels& channels, int64_t t_us) const;
  [[nodiscard]] Odometry odometry(const Channels& channels, int64_t t_us) const;
  /// Roll, pitch, velocity and rates of the channels that are relied on, for t_us; the pose itself is not filled in.
  [[nodiscard]] Odometry attitude(const Channels& channels, int64_t t_us) const;

  template <class Self, class Visitor>
  static void visit_members(Self& self, const Visitor& visit) {
    visit(self.leader_, self.velocity_, self.pose_, self.imm_, self.combined_, self.imm_us_, self.led_us_,
          self.attitude_);
  }

 private:
  [[nodiscard]] std::optional<FusionChannel> choose(const Channels& channels, int64_t t_us, bool with_ins,
                                                    std::optional<FusionChannel> now) const;
  void update_modes(const Channels& channels);

  FusionConfig config_;
  std::optional<FusionChannel> leader_, velocity_;
  CarriedPose pose_;
  Imm imm_;
  FusionEstimate combined_;  ///< of imm_
  int64_t imm_us_ = 0;
  int64_t led_us_ = 0;
  Odometry attitude_;  ///< newest sample of a channel that is relied on
};

}  // namespace roadfix
