#include <catch2/catch.hpp>
#include <roadfix/heartbeat_t.hpp>

#include "recorder/recorder_heartbeat.h"
#include "support/outage_bus.h"

namespace roadfix {
namespace {

using Dropped = std::map<std::string, int64_t>;

heartbeat_t told(RecorderHeartbeat& heartbeat, test::OutageBus& bus, const Dropped& dropped,
                 const std::optional<std::string>& stopped) {
  RunClock clock;
  return test::last_of<heartbeat_t>(bus, "HEARTBEAT_RECORDER",
                                    [&] { heartbeat.publish(bus, clock, dropped, stopped); });
}

TEST_CASE("the recorder says all that it lost, did not write and could not send") {
  RecorderHeartbeat heartbeat;
  test::OutageBus bus;
  const heartbeat_t well = told(heartbeat, bus, {}, std::nullopt);
  CHECK(well.state == heartbeat_t::STATE_RUNNING);
  CHECK(well.state_reason.empty());

  bus.gone = true;
  RunClock clock;
  for (int i = 0; i < 5; ++i) heartbeat.publish(bus, clock, {}, std::nullopt);
  bus.gone = false;
  const heartbeat_t bad = told(heartbeat, bus, {{"IMU", 3}, {"GNSS", 4}}, "the disk is full");
  CHECK(bad.state == heartbeat_t::STATE_DEGRADED);
  CHECK(bad.seq == 6);  // the unsent ones count: their gap shows
  CHECK_THAT(bad.state_reason, Catch::Contains("not recording: the disk is full"));
  CHECK_THAT(bad.state_reason, Catch::Contains("7 messages did not fit into memory"));
  CHECK_THAT(bad.state_reason, Catch::Contains("the network did not take 5 messages"));
}

TEST_CASE("a second recorder has a name and a channel of its own") {
  test::OutageBus bus;
  RunClock clock;
  RecorderHeartbeat heartbeat("recorder_camera");
  const auto h = test::last_of<heartbeat_t>(bus, "HEARTBEAT_RECORDER_CAMERA",
                                            [&] { heartbeat.publish(bus, clock, {}, std::nullopt); });
  CHECK(h.utime > 0);
  for (const std::string name : {"", "Camera", "a b", "a.*"})
    CHECK_THROWS_WITH(RecorderHeartbeat(name), Catch::Contains("'" + name + "'"));
}

}  // namespace
}  // namespace roadfix
