// Messages as they come from the bus, told to lib/health.
#include <catch2/catch.hpp>
#include <roadfix/health_t.hpp>
#include <roadfix/heartbeat_t.hpp>
#include <roadfix/imu_t.hpp>
#include <roadfix/pose_t.hpp>

#include "bus/types/message.h"
#include "config/config.h"
#include "monitor/handler.h"
#include "monitor/health_publisher.h"
#include "monitor/messages.h"
#include "support/outage_bus.h"
#include "support/shared_data.h"
#include "support/temporary_folder.h"

using namespace roadfix;

namespace {

constexpr int64_t kStart_us = 1'700'000'000'000'000;

struct Bench {
  MonitorHandler handler{MonitorConfig{}, Expectations{}};
  int64_t now_us = kStart_us;

  void bytes(const std::string& channel, const std::vector<uint8_t>& data) {
    handler.take({channel, data, now_us}, now_us);
  }
  template <class T>
  void send(const std::string& channel, T message, int64_t seq) {
    message.utime = now_us;
    message.run = 1;
    message.seq = seq;
    bytes(channel, encode(message));
  }
  std::string reasons() {
    handler.advance(now_us + 200'000);
    std::string all;
    for (const Condition& reason : handler.health().report().reasons) all += reason.text + "\n";
    return all;
  }
};

const ChannelReport* find(const HealthReport& report, const std::string& name) {
  for (const ChannelReport& channel : report.channels) {
    if (channel.name == name) return &channel;
  }
  return nullptr;
}

}  // namespace

TEST_CASE("garbage, wrong types and impossible numbers are counted per channel, and nothing throws") {
  Bench bench;
  bench.bytes("IMU", {1, 2, 3});
  bench.send("IMU", heartbeat_t{}, 0);
  imu_t absurd{};
  absurd.utime = INT64_MAX;
  bench.bytes("IMU", encode(absurd));
  bench.send("IMU", imu_t{}, 0);
  std::vector<uint8_t> cut = encode(pose_t{});
  cut.pop_back();
  bench.bytes("POSE_FUSED", cut);
  bench.bytes("HEARTBEAT_", {});
  bench.bytes("NOT_OURS", {1, 2, 3});
  CHECK_THAT(bench.reasons(), Catch::Contains("IMU has 3 messages that cannot be read"));
  const HealthReport report = bench.handler.health().report();
  REQUIRE(find(report, "IMU") != nullptr);
  CHECK(find(report, "IMU")->undecodable == 3);
  CHECK(find(report, "IMU")->received == 1);
  CHECK(find(report, "POSE_FUSED")->undecodable == 1);
  CHECK(find(report, "NOT_OURS") == nullptr);
}

TEST_CASE("a sample that is no number is told, one that is one is not") {
  Bench bench;
  imu_t imu{};
  bench.send("IMU", imu, 0);
  CHECK_THAT(bench.reasons(), !Catch::Contains("IMU"));
  imu.gyro_radps[1] = std::nan("");
  bench.now_us += 300'000;
  bench.send("IMU", imu, 1);
  CHECK_THAT(bench.reasons(), Catch::Contains("IMU sends values that are no numbers"));
}

TEST_CASE("a flood of forged channel names fills no memory") {
  Bench bench;
  for (int i = 0; i < 5000; ++i) bench.send("POSE_" + std::to_string(i), pose_t{}, 0);
  bench.handler.advance(bench.now_us + 200'000);
  CHECK(bench.handler.health().report().channels.size() == 256);
}

TEST_CASE("heartbeats name the process, the queue that waits longest is its queue") {
  heartbeat_t m{};
  m.state = heartbeat_t::STATE_NO_CLOCK;
  m.input_channel = {"IMU", "GNSS"};
  m.num_inputs = 2;
  m.input_queue_age_s = {0.1, 0.8};
  m.input_queue_depth = {3, 4};
  const HeartbeatFacts facts = heartbeat_facts(m);
  CHECK(facts.state == ProcessState::kNoClock);
  CHECK(facts.queue_channel == "GNSS");
  CHECK(facts.queue_age_s == 0.8);
  CHECK(facts.queue_depth == 7);
  CHECK(process_of_channel("HEARTBEAT_GNSS_INS_EKF") == "gnss_ins_ekf");
}

TEST_CASE("every channel of the design has its type") {
  CHECK(type_of_channel("CAMERA_LEFT") == "image_t");
  CHECK(type_of_channel("POSE_VO_MAP") == "pose_t");
  CHECK(type_of_channel("REFERENCE") == "pose_t");
  CHECK(type_of_channel("HEARTBEAT_X") == "heartbeat_t");
  CHECK(type_of_channel("IMU") == "imu_t");
  CHECK(type_of_channel("IMU2").empty());
  CHECK(type_of_channel("").empty());
}

TEST_CASE("the report is HEALTH, field by field") {
  HealthReport report;
  report.verdict = Verdict::kDegraded;
  report.judged_pose = "POSE_FUSED";
  report.reasons = {{"channel.GNSS.silent", Verdict::kDegraded, 0, "GNSS is silent"}};
  ChannelReport channel;
  channel.name = "GNSS";
  channel.expected_hz = 4.0;
  channel.lost = 7;
  report.channels = {channel};
  const auto m = decode<health_t>(encode(health_message(report)));
  CHECK(m.verdict == health_t::VERDICT_DEGRADED);
  CHECK(m.pose_channel == "POSE_FUSED");
  REQUIRE(m.num_reasons == 1);
  CHECK(m.reason[0] == "GNSS is silent");
  CHECK(m.reason_key[0] == "channel.GNSS.silent");
  REQUIRE(m.num_channels == 1);
  CHECK(m.channel_expected_hz[0] == 4.0);
  CHECK(m.channel_lost[0] == 7);
  CHECK(m.channel_age_s[0] == -1.0);
}

TEST_CASE("a vehicle's folder says what to expect") {
  const Expectations demo = expectations_of(MonitorConfig{}, test::source_path("configs/demo"));
  std::map<std::string, double> rates;
  for (const ExpectedChannel& channel : demo.channels) rates[channel.name] = channel.rate.value_or(0.0);
  CHECK(rates == std::map<std::string, double>{{"IMU", 100.0}, {"GNSS", 4.0}, {"WHEELS", 20.0}, {"CAMERA_LEFT", 10.0}});
  CHECK(demo.processes == std::vector<std::string>{"recorder", "gnss_ins_ekf", "wheel_odometry", "vo_tracker",
                                                   "imm_fusion", "integrity"});
  MonitorConfig config;
  config.channels = {{"IMU", 200.0}, {"POSE_VO", std::nullopt}};
  CHECK(expectations_of(config, test::source_path("configs/demo")).channels.front().rate == 200.0);
  CHECK(expectations_of(config, "").channels.size() == 2);
  const auto example = load_config<MonitorConfig>(test::source_path("configs/example/monitor.yaml"));
  CHECK(example.channels.front().name == "POSE_VO");
  CHECK(example.health.process.disk_gib == 20.0);
}

TEST_CASE("the monitor says what the network did not take of its own messages") {
  for (const bool gone : {true, false}) {
    test::OutageBus bus;
    HealthPublisher publisher(bus, 0.5, kStart_us);
    HealthReport report;
    bus.gone = gone;
    report.now_us = kStart_us;
    publisher.decided(report, true);  // listens
    report.now_us += 1'300'000;
    publisher.decided(report, true);  // HEALTH and a heartbeat
    bus.gone = false;
    report.now_us += 1'000'000;
    const auto h = test::last_of<heartbeat_t>(bus, "HEARTBEAT_MONITOR", [&] { publisher.decided(report, true); });
    CHECK(h.state == (gone ? heartbeat_t::STATE_DEGRADED : heartbeat_t::STATE_RUNNING));
    CHECK(h.state_reason == (gone ? "the network did not take 2 messages" : ""));
  }
}

TEST_CASE("of two monitors the older is the one that was started first, however late its first word") {
  for (const bool older : {true, false}) {
    test::OutageBus bus;
    HealthPublisher publisher(bus, 0.5, kStart_us);
    int received = 0;
    bus.subscribe("HEALTH", [&received](const BusMessage&) { ++received; });
    health_t other{};
    other.utime = kStart_us + 700'000;
    other.run = kStart_us + (older ? 500'000 : -500'000);
    const std::vector<uint8_t> bytes = encode(other);
    publisher.received({"HEALTH", bytes, other.utime}, other.utime);
    HealthReport report;
    for (const int64_t after_us : {800'000, 2'100'000}) {
      report.now_us = kStart_us + after_us;
      publisher.decided(report, true);
    }
    while (bus.handle(std::chrono::milliseconds(0))) continue;
    CHECK(received == (older ? 1 : 0));
  }
}

TEST_CASE("of two monitors the younger is silent, and speaks when the older is gone") {
  test::OutageBus bus;
  HealthPublisher publisher(bus, 0.5, kStart_us);
  HealthReport report;
  int received = 0;
  bus.subscribe("HEALTH", [&received](const BusMessage&) { ++received; });
  const auto published = [&](int64_t after_us) {
    received = 0;
    report.now_us = kStart_us + after_us;
    publisher.decided(report, true);
    while (bus.handle(std::chrono::milliseconds(0))) continue;
    return received == 1;
  };
  const auto hear = [&](int64_t run, int64_t after_us) {
    health_t other{};
    other.utime = kStart_us + after_us;
    other.run = run;
    const std::vector<uint8_t> bytes = encode(other);
    publisher.received({"HEALTH", bytes, other.utime}, other.utime);
  };
  CHECK_FALSE(published(0));
  CHECK_FALSE(published(1'000'000));
  CHECK(published(1'300'000));
  hear(kStart_us + 900'000, 1'400'000);  // younger: that one has to be silent
  CHECK(published(1'500'000));
  hear(kStart_us, 1'600'000);  // its own, come back
  CHECK(published(1'700'000));
  hear(kStart_us - 60'000'000, 2'000'000);
  CHECK_FALSE(published(2'100'000));
  CHECK_FALSE(published(4'900'000));
  CHECK(published(5'100'000));
}
