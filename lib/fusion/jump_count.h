/// Counts the jumps of a published pose: what it moved beyond the motion of one that never jumps.
#pragma once

#include "fusion/planar.h"
#include "stream/state_bytes.h"

namespace roadfix {

class JumpCount {
 public:
  /// The newest published pose beside POSE_LOCAL's; another frame is a jump always. `least`: m.
  void add(const Odometry& fused, const Odometry& local, bool enu, double least);

  [[nodiscard]] int count() const { return count_; }
  [[nodiscard]] const Planar& last() const { return last_; }  ///< new minus old
  [[nodiscard]] double last_height() const { return last_height_; }

  template <class Self, class Visitor>
  static void visit_members(Self& self, const Visitor& visit) {
    visit(self.started_, self.enu_, self.count_, self.last_, self.last_height_, self.fused_, self.local_, self.height_,
          self.local_height_);
  }

 private:
  bool started_ = false;
  bool enu_ = false;
  int count_ = 0;
  Planar last_ = Planar::Zero();
  double last_height_ = 0.0;
  Planar fused_ = Planar::Zero(), local_ = Planar::Zero();
  double height_ = 0.0, local_height_ = 0.0;
};

}  // namespace roadfix
