// When each source was last used, and jumps of the pose.
#include "navigation/aiding/aiding_log.h"

#include <catch2/catch.hpp>

#include "navigation/initialisation/start_monitor.h"
#include "navigation/pose_resets.h"

using namespace roadfix;
using namespace roadfix::navigation;

TEST_CASE("only what was used counts as aiding") {
  AidingLog log;
  log.add(record_of(AidingSource::kGnssPosition, AidingStatus::kGated, 1'000'000), 7);
  CHECK_FALSE(log.take_fresh());
  CHECK(log.aided_by(1'000'000, 3.0) == 0);
  log.add(record_of(AidingSource::kWheelSpeed, AidingStatus::kAccepted, 2'000'000));
  CHECK(log.take_fresh());
  CHECK_FALSE(log.take_fresh());
  log.set_used(AidingSource::kZeroVelocity, 4'000'000);
  CHECK_FALSE(log.take_fresh());
  CHECK(log.aided_by(5'000'000, 3.0) ==
        (1 << static_cast<int>(AidingSource::kWheelSpeed) | 1 << static_cast<int>(AidingSource::kZeroVelocity)));
  CHECK(log.aided_by(5'000'001, 3.0) == 1 << static_cast<int>(AidingSource::kZeroVelocity));
  CHECK(log.since(AidingSource::kWheelSpeed, 5'000'000) == Approx(3.0));
  CHECK(log.last_use_us({AidingSource::kGnssPosition, AidingSource::kWheelSpeed}) == 2'000'000);
  REQUIRE(log.records().size() == 2);
  CHECK(log.records().front().id == 7);
  log.clear_records();
  CHECK(log.records().empty());
  CHECK(log.since(AidingSource::kWheelSpeed, 5'000'000) == Approx(3.0));
}

TEST_CASE("a filter that was given up jumps once, when its pose is there again") {
  PoseResets resets;
  Mean x;
  x.nav.position = {3.0, 4.0, 0.0};
  resets.resume(x);
  CHECK(resets.counter() == 0);
  resets.abandon({Eigen::Quaterniond::Identity(), Eigen::Vector3d(1.0, 1.0, 1.0)});
  CHECK(resets.pending());
  resets.resume(x);
  resets.resume(x);
  CHECK(resets.counter() == 1);
  CHECK(resets.delta().p.isApprox(Eigen::Vector3d(2.0, 3.0, -1.0)));
  CHECK_FALSE(resets.pending());
}

TEST_CASE("three seconds of driving backwards contradict a heading, unless they are excused") {
  Mean x;
  x.nav.velocity = {-6.0, 0.0, 0.0};
  for (const bool excused : {false, true}) {
    StartMonitor monitor;
    monitor.begin(x, 1'000'000, true);
    bool wrong = false;
    for (x.t_us = 1'000'000; x.t_us <= 4'100'000; x.t_us += 100'000)
      wrong = monitor.heads_backwards(x, excused && x.t_us == 2'000'000);
    CHECK(wrong == !excused);
  }
}

TEST_CASE("a remembered heading is agreed with by fixes over some way alone") {
  Mean x;
  StartMonitor monitor;
  monitor.begin(x, 0, false);
  monitor.see_fix(x, false);
  CHECK_FALSE(monitor.agreed());
  x.nav.position.x() = 40.0;
  monitor.see_fix(x, true);
  CHECK_FALSE(monitor.agreed());
  monitor.see_fix(x, false);
  CHECK(monitor.agreed());
}
