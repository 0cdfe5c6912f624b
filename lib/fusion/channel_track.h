/// Sum of a channel's measured motions, at any time of the last 0.8 s: a witness that is late is compared, and carried on
/// by, at its own time (MODEL.md, sections 6 and 7).
#pragma once

#include <cstdint>
#include <deque>

#include "fusion/planar.h"

namespace roadfix {

class ChannelTrack {
 public:
  struct Point {
    int64_t t_us = 0;
    Planar way = Planar::Zero();  ///< since the first sample
    double rise = 0.0;            ///< m, likewise
    template <class Self, class Visitor>
    static void visit_members(Self& self, const Visitor& visit) {
      visit(self.t_us, self.way, self.rise);
    }
  };

  /// What comes cannot be compared with what came before.
  void begin_segment();
  void add(const Planar& way, double rise);
  /// The newest sample is of t_us.
  void reach(int64_t t_us);

  [[nodiscard]] const Planar& way() const { return sum_.way; }
  /// Between samples, or carried on by the newest one's velocity.
  [[nodiscard]] Point at(int64_t t_us, const LevelView& newest) const;
  /// Whether it reaches back to that time.
  [[nodiscard]] bool has(int64_t t_us) const { return !recent_.empty() && recent_.front().t_us <= t_us; }
  /// Tracks of one segment can be compared.
  [[nodiscard]] int segment() const { return segment_; }

  template <class Self, class Visitor>
  static void visit_members(Self& self, const Visitor& visit) {
    visit(self.sum_, self.recent_, self.segment_);
  }

 private:
  Point sum_;
  std::deque<Point> recent_;  ///< oldest first
  int segment_ = 0;
};

}  // namespace roadfix
