#include "bus/run/live_stage.h"

#include <catch2/catch.hpp>

#include "bus/transport/log_bus.h"
#include "bus/transport/memory_bus.h"
#include "support/chain_stage.h"
#include "support/outage_bus.h"
#include "support/small_drive.h"
#include "support/temporary_folder.h"

using namespace roadfix;
using namespace roadfix::test;

namespace {

/// Everything published on a bus, per channel.
struct Ear {
  std::map<std::string, std::vector<std::vector<uint8_t>>> heard;
  explicit Ear(Bus& bus) {
    bus.subscribe(".*", [this](const BusMessage& m) {
      heard[std::string(m.channel)].emplace_back(m.bytes.begin(), m.bytes.end());
    });
  }
};

std::unique_ptr<Stage> make_filter() { return std::make_unique<ChainStage>(filter_spec()); }

}  // namespace

TEST_CASE("a stage on a bus publishes outputs, ledger, heartbeat and configuration") {
  MemoryBus bus;
  Ear ear(bus);
  LiveStage live(make_filter, bus);
  live.step(std::chrono::milliseconds(0));
  const heartbeat_t starting = decode<heartbeat_t>(ear.heard["HEARTBEAT_FILTER"].at(0));
  REQUIRE(starting.state == heartbeat_t::STATE_STARTING);
  const config_t config = decode<config_t>(ear.heard["CONFIG_FILTER"].at(0));
  REQUIRE(config.config_yaml == "factor: 0.99\n");
  REQUIRE(config.build_id == "test");
  REQUIRE_FALSE(config.library_versions.empty());
  REQUIRE_FALSE(config.cpu_features.empty());

  for (const DriveMessage& message : small_drive(3.0)) {
    if (message.channel == "GNSS" && message.header.seq == 5) continue;
    bus.publish(message.channel, message.bytes);
  }
  std::vector<uint8_t> broken(40, 7);
  bus.publish("WHEELS", broken);
  live.step(std::chrono::milliseconds(0));
  live.stop();
  bus.handle(std::chrono::milliseconds(0));
  REQUIRE(ear.heard["POSE_INS"].size() == 300);
  const heartbeat_t last = decode<heartbeat_t>(ear.heard["HEARTBEAT_FILTER"].back());
  REQUIRE(last.state == heartbeat_t::STATE_STOPPING);
  REQUIRE(last.num_inputs == 3);
  REQUIRE(last.input_channel == std::vector<std::string>{"IMU", "GNSS", "WHEELS"});
  REQUIRE(last.input_received[0] == 300);
  REQUIRE(last.input_lost[1] == 1);
  REQUIRE(last.input_undecodable[2] == 1);
  REQUIRE(last.rss_bytes > 1'000'000);
  const ledger_t ledger = decode<ledger_t>(ear.heard["LEDGER_FILTER"].back());
  const auto lost = std::find_if(ledger.entries.begin(), ledger.entries.end(),
                                 [](const ledger_entry_t& e) { return e.kind == ledger_entry_t::KIND_LOST; });
  REQUIRE(lost != ledger.entries.end());
  REQUIRE(lost->channel == "GNSS");
  REQUIRE((lost->first_seq == 5 && lost->last_seq == 5));
  const pose_t pose = decode<pose_t>(ear.heard["POSE_INS"].back());
  REQUIRE(pose.provenance.ledger_entries == ledger.num_entries_total);
  REQUIRE(pose.run == kDriveStart_us);
  REQUIRE(pose.provenance.last_seq == std::vector<int64_t>{274, 10, 137});
  REQUIRE(pose.provenance.num_applied == std::vector<int64_t>{275, 10, 138});
}

TEST_CASE("a message with impossible numbers is undecodable") {
  MemoryBus bus;
  Ear ear(bus);
  LiveStage live(make_filter, bus);
  for (const DriveMessage& message : small_drive(2.0)) bus.publish(message.channel, message.bytes);
  for (const int64_t extreme : {std::numeric_limits<int64_t>::max(), std::numeric_limits<int64_t>::min()}) {
    for (int64_t imu_t::*field : {&imu_t::utime, &imu_t::run, &imu_t::seq}) {
      imu_t imu{};
      imu.utime = kDriveStart_us + 3'000'000;
      imu.run = kDriveStart_us;
      imu.*field = extreme;
      bus.publish("IMU", encode(imu));
    }
  }
  live.step(std::chrono::milliseconds(0));
  REQUIRE(live.runner().stream().track(0).counters.undecodable == 6);
  REQUIRE(ear.heard["POSE_INS"].size() == 200);
}

TEST_CASE("one stamp that is years ahead does not keep a silent input young") {
  MemoryBus bus;
  Ear ear(bus);
  LiveStage live(make_filter, bus);
  for (DriveMessage message : small_drive(8.0)) {
    if (message.channel == "GNSS" && message.header.utime >= kDriveStart_us + 3'000'000) continue;
    if (message.channel == "GNSS" && message.header.seq == 4) {
      message = drive_message("GNSS", message.header.utime + 31'557'600'000'000, 4, decode<gnss_t>(message.bytes));
    }
    bus.publish(message.channel, message.bytes);
    live.step(std::chrono::milliseconds(0));
  }
  live.stop();
  bus.handle(std::chrono::milliseconds(0));
  const heartbeat_t last = decode<heartbeat_t>(ear.heard["HEARTBEAT_FILTER"].back());
  CHECK(last.input_age_s[1] == Approx(5.24).margin(0.02));  // of the fix at 2.75 s, at 7.99 s
  CHECK(last.input_applied[1] == 11);                       // of twelve
}

TEST_CASE("two publishers on a channel are said") {
  MemoryBus bus;
  Ear ear(bus);
  LiveStage live(make_filter, bus);
  for (const DriveMessage& message : small_drive(2.0)) {
    bus.publish(message.channel, message.bytes);
    if (message.channel != "WHEELS") continue;
    wheels_t other = decode<wheels_t>(message.bytes);
    other.run += 1000;
    bus.publish("WHEELS", encode(other));
  }
  live.step(std::chrono::milliseconds(0));
  live.stop();
  bus.handle(std::chrono::milliseconds(0));
  const heartbeat_t last = decode<heartbeat_t>(ear.heard["HEARTBEAT_FILTER"].back());
  REQUIRE_THAT(last.state_reason, Catch::Contains("WHEELS: two publishers"));
}

TEST_CASE("a recorded log is a bus: its order of arrival gives the same outputs live, twice") {
  TemporaryFolder folder;
  write_drive(folder / "in.lcm", small_drive(5.0));
  std::string bytes[2];
  for (std::string& result : bytes) {
    LogBus bus(folder / "in.lcm");
    struct Catcher : MessageSink {
      std::string all;
      void put(const std::string& channel, const Header&, std::span<const uint8_t> b) override {
        if (channel == "POSE_INS") all.append(b.begin(), b.end());
      }
    } catcher;
    StageRunner runner(std::make_unique<ChainStage>(filter_spec()), catcher);
    for (int i = 0; i < 3; ++i) {
      bus.subscribe(runner.spec().inputs[static_cast<std::size_t>(i)].channel,
                    [&runner, i](const BusMessage& m) { runner.offer(i, m.bytes); });
    }
    while (bus.handle(std::chrono::milliseconds(0))) {
    }
    result = catcher.all;
  }
  REQUIRE(bytes[0].size() > 10'000);
  REQUIRE(bytes[0] == bytes[1]);
}

TEST_CASE("stamps gone back are five in order of one publisher, not strays, forged or broken ones") {
  constexpr int64_t kNow_us = 1'700'000'000'000'000, kHour_us = 3'600'000'000;
  const auto confirmed = [](const std::vector<std::pair<int, Header>>& messages) {
    BackwardStampDetector back(3);
    bool any = false;
    for (const auto& [input, header] : messages) any = back.detect(input, header, kNow_us) || any;
    return any;
  };
  const auto at = [&](int i) { return Header{kNow_us - kHour_us + 10'000 * i, 7, i}; };
  REQUIRE(confirmed({{0, at(0)}, {0, at(1)}, {1, at(0)}, {0, at(2)}, {1, at(1)}, {0, at(3)}, {0, at(4)}}));
  REQUIRE_FALSE(confirmed({{0, at(0)}, {0, at(1)}, {0, at(2)}, {1, at(3)}, {1, at(4)}, {2, at(5)}}));
  REQUIRE_FALSE(confirmed({{0, at(5)}, {0, at(4)}, {0, at(3)}, {0, at(2)}, {0, at(1)}}));
  std::vector<std::pair<int, Header>> broken, runs;
  for (int i = 0; i < 9; ++i) {
    broken.push_back({0, {std::numeric_limits<int64_t>::min() + i, 1, i}});
    runs.push_back({0, {kNow_us - kHour_us + i, i, 0}});
  }
  REQUIRE_FALSE(confirmed(broken));
  REQUIRE_FALSE(confirmed(runs));
}

TEST_CASE("broken and forged clock samples do not begin a new run, whatever times they claim") {
  MemoryBus bus;
  Ear ear(bus);
  LiveStage live(make_filter, bus);
  for (const DriveMessage& message : small_drive(2.0)) bus.publish(message.channel, message.bytes);
  live.step(std::chrono::milliseconds(0));
  imu_t forged{};
  forged.run = 1;
  for (const int64_t utime :
       {std::numeric_limits<int64_t>::min(), int64_t{0}, int64_t{-1}, int64_t{1'000'000'000'000}}) {
    for (int i = 0; i < 9; ++i) {
      forged.utime = utime;
      bus.publish("IMU", encode(forged));
      live.step(std::chrono::milliseconds(0));
    }
  }
  for (const DriveMessage& message : small_drive(4.0)) {
    if (message.header.utime > kDriveStart_us + 2'000'000) bus.publish(message.channel, message.bytes);
  }
  live.step(std::chrono::milliseconds(0));
  for (const std::vector<uint8_t>& bytes : ear.heard["POSE_INS"]) REQUIRE(read_header(bytes)->run == kDriveStart_us);
  REQUIRE(read_header(ear.heard["POSE_INS"].back())->utime > kDriveStart_us + 3'900'000);
}

TEST_CASE("what the network did not take is told until some heartbeats came through") {
  UnsentMonitor watch;
  watch.note(1'000'000, 0);
  REQUIRE(watch.state_reason(1'000'000).empty());
  watch.note(2'000'000, 7);
  REQUIRE(watch.state_reason(4'900'000) == "the network did not take 7 messages");
  watch.note(4'900'000, 7);
  REQUIRE(watch.state_reason(5'100'000).empty());

  for (const bool gone : {true, false}) {
    OutageBus bus;
    LiveStage live(make_filter, bus);
    bus.gone = gone;
    live.step(std::chrono::milliseconds(0));  // a heartbeat and the configuration
    bus.gone = false;
    const auto told = last_of<heartbeat_t>(bus, "HEARTBEAT_FILTER", [&] { live.stop(); }).state_reason;
    REQUIRE((told.find("did not take 2 messages") != std::string::npos) == gone);
  }
}
