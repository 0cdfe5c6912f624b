/// Carries the fused poses from the horizon to now: the fusion stands at the horizon, and the clock channel's newest
/// samples, which it may not use yet, tell the motion since by their velocities (MODEL.md, section 10).
#pragma once

#include <deque>

#include "fusion/fusion.h"

namespace roadfix {

/// The way up to a sample, summed up from some sample on: differences alone count.
struct OutlookStep {
  int64_t t_us = 0;
  FusionChannel channel = FusionChannel::kIns;
  bool metric = true;
  bool known = false;  ///< the sample itself was valid
  Odometry felt;
  LevelView view;  ///< of felt
  Planar way = Planar::Zero();
  double rise = 0.0;                   ///< m
  double silent = 0.0;                 ///< s in which nobody told the motion
  Planar correction = Planar::Zero();  ///< by which the sample's pose is not where the velocities lead
};

class Outlook {
 public:
  /// A clock sample, ahead of the fusion. Samples come in the order of their times.
  void see(const ChannelSample& sample);
  /// The fusion has reached this time.
  void drop_until(int64_t t_us);

  /// Both poses for the newest sample; for the fusion's own time where none is ahead.
  [[nodiscard]] Fusion::Poses poses(const Fusion& fusion) const;

  /// What was dropped last, from which later sums start; load() forgets the samples ahead: they come again.
  void save(StateWriter& writer) const;
  void load(StateReader& reader);

 private:
  [[nodiscard]] ReturnState returned(const Fusion& fusion, bool follows) const;

  template <class Self, class Visitor>
  static void visit_step(Self& step, const Visitor& visit);

  std::optional<OutlookStep> last_;  ///< the newest of those dropped
  std::deque<OutlookStep> ahead_;
};

}  // namespace roadfix
