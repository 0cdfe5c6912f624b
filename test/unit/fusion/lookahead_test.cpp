/// From the horizon to now by the clock's newest samples; jumps of a published pose.
#include "fusion/lookahead.h"

#include <catch2/catch.hpp>

#include "fusion/jump_count.h"

namespace roadfix {
namespace {

/// Drives along x with 10 m/s.
ChannelSample at(double t_s, double off = 0.0) {
  ChannelSample s;
  s.odometry.t_us = static_cast<int64_t>(t_s * 1e6);
  s.odometry.T_frame_vehicle.p.x() = 10.0 * t_s + off;
  s.odometry.velocity.x() = 10.0;
  s.odometry.validity = Validity::kValid;
  return s;
}

TEST_CASE("motion ahead is that of the velocities, from where the fusion stands, corrections are apart") {
  Lookahead ahead;
  CHECK(!ahead.from(0));
  for (const double t : {0.0, 0.1, 0.2}) ahead.see(at(t));
  ahead.see(at(0.3, 5.0));
  ahead.drop_until(100'000);
  const auto from = ahead.from(150'000);
  REQUIRE(from);
  CHECK(from->valid);
  CHECK(from->dt == Approx(0.15));
  CHECK(from->motion.x() == Approx(1.5));
  CHECK(from->correction.x() == Approx(5.0));
  CHECK(from->newest.t_us == 300'000);
  CHECK(!ahead.from(300'000));
}

TEST_CASE("an invalid sample, a gap or another map ahead makes what is ahead invalid") {
  for (const int fault : {0, 1, 2, 3}) {
    Lookahead ahead;
    ahead.see(at(0.0));
    ahead.drop_until(0);
    ChannelSample s = at(fault == 1 ? 1.0 : 0.1);
    if (fault == 2) s.odometry.validity = Validity::kInvalid;
    if (fault == 3) s.reset_counter = 1;
    ahead.see(s);
    REQUIRE(ahead.from(0));
    CAPTURE(fault);
    CHECK(ahead.from(0)->valid == (fault == 0));
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
