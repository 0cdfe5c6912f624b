/// Jumps of the published pose: how many there were, and the last of them. A filter that is given up leaves its pose, and the
/// next one jumps from there.
#pragma once

#include <optional>

#include "geometry/so3.h"
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
  /// So many jumps of poses that were published until now; another one follows.
  void go_on(int jumps) { counter_ += jumps; }

  [[nodiscard]] int counter() const { return counter_; }
  /// p new minus old; q_old^-1 q_new.
  [[nodiscard]] const SE3& delta() const { return delta_; }
  /// The same of the vehicle's axes.
  [[nodiscard]] SE3 published_delta(const Mean& x) const {
    const Eigen::Quaterniond q_imu_vehicle = exp_q(Eigen::Vector3d(0.0, x.mounting.x(), x.mounting.y()));
    return {q_imu_vehicle.conjugate() * delta_.q * q_imu_vehicle, delta_.p};
  }

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
