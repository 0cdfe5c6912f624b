/// Jumps of the published pose: how many there were, and the last of them. A filter that is given up leaves its pose, and the
/// next one jumps from there.
#pragma once

#include <optional>

#include "navigation/serialise_optional.h"
#include "navigation/state.h"

namespace roadfix::navigation {

/// The imu's in the level frame.
inline SE3 pose_of(const Mean& x) { return {x.nav.q_level_imu, x.nav.position}; }

class PoseResets {
 public:
  void count(const SE3& before, const SE3& after) {
    ++counter_;
    delta_.p = after.p - before.p;
    delta_.q = before.q.conjugate() * after.q;
    abandoned_.reset();
  }
  void count(const SE3& before, const Mean& after) { count(before, pose_of(after)); }
  /// The filter whose pose this is was given up.
  void abandon(const SE3& pose) { abandoned_ = pose; }
  [[nodiscard]] bool pending() const { return abandoned_.has_value(); }
  /// The pose is published again: a jump, where a filter was given up.
  void resume(const SE3& now) {
    if (abandoned_) count(*abandoned_, now);
  }
  void resume(const Mean& now) { resume(pose_of(now)); }
  /// Those of `other`, whose poses were published until now, count too.
  void go_on(const PoseResets& other) {
    counter_ += other.counter_;
    delta_ = other.delta_;
  }

  [[nodiscard]] int counter() const { return counter_; }
  /// p new minus old; q_old^-1 q_new.
  [[nodiscard]] const SE3& delta() const { return delta_; }

  template <class Archive>
  void serialise(Archive& a) {
    serialise_optional(
        a, abandoned_, [] { return SE3(); }, [&](SE3& T) { a(T.q.coeffs(), T.p); });
    a(counter_, delta_.p, delta_.q.coeffs());
  }

 private:
  int counter_ = 0;
  SE3 delta_;
  std::optional<SE3> abandoned_;
};

}  // namespace roadfix::navigation
