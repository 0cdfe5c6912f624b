/// The newest samples of the clock's channel, which the fusion may not use yet: what they say of the motion from its
/// time to now (MODEL.md, section 7).
#pragma once

#include <deque>
#include <optional>

#include "fusion/pose_channel.h"

namespace roadfix {

class Lookahead {
 public:
  /// A clock sample, in the order of their times.
  void see(const ChannelSample& sample);
  /// The fusion has reached this time.
  void drop_until(int64_t t_us);

  struct Ahead {
    FusionChannel channel = FusionChannel::kIns;
    Planar motion = Planar::Zero();  ///< as the channel's velocities have it
    double rise = 0.0;
    double dt = 0.0;
    Odometry newest;
    bool valid = false;                  ///< all samples ahead are, and of one map
    Planar correction = Planar::Zero();  ///< by which the newest pose is not where the velocities lead
    bool enu = false;
  };
  /// From that time to the newest sample; nothing where none is ahead.
  [[nodiscard]] std::optional<Ahead> from(int64_t t_us) const;
  [[nodiscard]] std::optional<int64_t> newest_us() const;

  /// What was dropped last, from which sums start; the samples ahead come again.
  template <class Self, class Visitor>
  static void visit_members(Self& self, const Visitor& visit) {
    visit(self.last_);
  }

 private:
  struct Entry {
    ChannelSample sample;
    LevelView view;
    Planar way = Planar::Zero();  ///< from the first entry on: differences count
    double rise = 0.0;
    bool joined = false;                ///< to its predecessor: same channel and map, both valid
    Planar corrected = Planar::Zero();  ///< summed likewise, in the channel's frame
    template <class Self, class Visitor>
    static void visit_members(Self& self, const Visitor& visit) {
      visit(self.sample, self.view, self.way, self.rise, self.joined, self.corrected);
    }
  };
  std::optional<Entry> last_;  ///< the newest of those dropped
  std::deque<Entry> ahead_;
};

}  // namespace roadfix
