/// From the horizon to now by the clock's newest sample; jumps of a published pose.
#include "fusion/pose_output.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "fusion/fusion.h"

namespace roadfix {
namespace {

/// An INS that drives along x with 10 m/s.
ChannelSample at(double t_s, double off = 0.0) {
  ChannelSample s;
  s.odometry.t_us = 1'000'000 + static_cast<int64_t>(std::llround(t_s * 1e6));
  s.odometry.T_frame_vehicle.p.x() = 10.0 * t_s + off;
  s.odometry.velocity.x() = 10.0;
  s.odometry.cov_pose.diagonal().setConstant(1e-4);
  s.odometry.cov_velocity.diagonal().setConstant(1e-4);
  s.odometry.validity = Validity::kValid;
  s.enu = s.by_velocity = true;
  return s;
}

/// One that took in 2 s of it, its horizon at 1.95 s.
Fusion driven() {
  Fusion fusion({});
  for (int i = 0; i < 40; ++i) (void)fusion.add(at(0.05 * i));
  return fusion;
}

TEST_CASE(
    "the pose for now is the INS's newest, unless it corrected itself without a fix: then where its velocity leads") {
  for (const double off : {0.0, 5.0}) {
    Fusion fusion = driven();
    NewestSample newest;
    newest.see(at(2.1, off));
    const FusedPoses poses = fusion.publish(newest);
    CAPTURE(off);
    CHECK(poses.fused.t_us == at(2.1).odometry.t_us);
    CHECK(poses.fused.T_frame_vehicle.p.x() == Approx(21.0).margin(1e-6));
    CHECK(poses.local.T_frame_vehicle.p.x() == Approx(poses.fused.T_frame_vehicle.p.x()).margin(1e-3));
    CHECK(poses.fused.validity == (off == 0.0 ? Validity::kValid : Validity::kCoasting));
  }
}

TEST_CASE(
    "a newest sample that is invalid, no pose, after an invalid one, after a gap or of another map is not published") {
  for (const int fault : {0, 1, 2, 3, 4, 5}) {
    Fusion fusion = driven();
    NewestSample newest;
    ChannelSample s = at(2.05);
    if (fault == 1) s.odometry.validity = Validity::kInvalid;
    if (fault == 2) s.odometry.T_frame_vehicle.p.x() = std::nan("");
    if (fault == 3) {
      ChannelSample before = at(2.0);
      before.odometry.validity = Validity::kInvalid;
      newest.see(before);
    }
    if (fault == 4) s = at(2.5);
    if (fault == 5) s.reset_counter = 1;
    newest.see(s);
    const FusedPoses poses = fusion.publish(newest);
    CAPTURE(fault);
    CHECK(poses.fused.t_us == s.odometry.t_us);
    CHECK(poses.fused.validity == (fault == 0 ? Validity::kValid : Validity::kCoasting));
    CHECK(poses.fused.T_frame_vehicle.p.x() == Approx(10.0 * (fault == 4 ? 2.5 : 2.05)).margin(0.01));
  }
}

TEST_CASE("a jump beyond the limit, or another frame, is counted with what it was") {
  JumpCount count;
  const auto pose = [](double x) {
    Odometry o;
    o.T_frame_vehicle.p.x() = x;
    return o;
  };
  count.add(pose(0.0), pose(0.0), false, 0.3);
  count.add(pose(1.2), pose(1.0), false, 0.3);
  CHECK(count.count() == 0);
  count.add(pose(5.2), pose(2.0), false, 0.3);
  CHECK(count.count() == 1);
  CHECK(count.last().x() == Approx(3.0));
  count.add(pose(6.2), pose(3.0), true, 0.3);
  CHECK(count.count() == 2);
}

}  // namespace
}  // namespace roadfix
