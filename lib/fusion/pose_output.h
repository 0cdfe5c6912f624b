/// What the fusion publishes: both poses for now, their validity and the reason (MODEL.md, section 7).
#pragma once

#include <optional>
#include <string>

#include "fusion/failover.h"
#include "fusion/jump_count.h"

namespace roadfix {

/// The newest sample of the clock's channel, which the fusion may not use yet.
struct NewestSample {
  std::optional<ChannelSample> sample;
  std::optional<int64_t> invalid_us;  ///< of the newest one that was invalid or no pose

  void see(const ChannelSample& s) {
    if (s.odometry.validity == Validity::kInvalid || !usable(s.odometry)) invalid_us = s.odometry.t_us;
    sample = s;
  }
};

enum class FusionPhase { kWaiting, kRunning, kWeak, kLost };

struct FusionReport {
  FusionPhase phase = FusionPhase::kWaiting;
  Validity validity = Validity::kInvalid;
  Validity local_validity = Validity::kInvalid;
  bool enu = false;
  bool follows_ins = false;
  std::optional<FusionChannel> leader;  ///< whose motion carries POSE_LOCAL, and POSE_FUSED where it does not follow
  std::string reason;
  int reset_counter = 0;
  Planar last_jump = Planar::Zero();  ///< published new minus old
  double last_jump_height = 0.0;      ///< m
};

struct FusedPoses {
  Odometry fused, local;
  FusionReport report;
};

/// What the fusion has when it publishes.
struct FusionNow {
  const FusionConfig& config;
  const Channels& channels;
  const LocalMotion& local;
  const Failover& failover;
  int64_t t_us = 0;

  [[nodiscard]] const PoseChannel& channel(FusionChannel c) const { return channels[static_cast<std::size_t>(c)]; }
};

class PoseOutput {
 public:
  /// `dt` s after the last call. A worse validity counts at once, a better one when it has held for a while.
  void settle(const FusionNow& now, double dt);

  /// Both poses at the time of `newest`, or at now.t_us where that is not ahead; before the start none. Counts the jumps
  /// of the published pose.
  FusedPoses publish(const FusionNow& now, bool started, const NewestSample& newest);

  /// In plain words, what keeps POSE_FUSED from being the INS's pose with fixes; empty where nothing does.
  [[nodiscard]] static std::string reason(const FusionNow& now);

  template <class Self, class Visitor>
  static void visit_members(Self& self, const Visitor& visit) {
    visit(self.jumps_, self.validity_, self.better_for_);
  }

 private:
  [[nodiscard]] FusionReport report(const FusionNow& now) const;

  JumpCount jumps_;
  Validity validity_ = Validity::kInvalid;  ///< of POSE_FUSED
  double better_for_ = 0.0;                 ///< s for which a better one has held
};

}  // namespace roadfix
