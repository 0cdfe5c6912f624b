// The stages that a car runs: neither the order of arrival, nor duplicates, nor threads beside it show in a single
// byte; and what verify says of each.
#include "replay/shipped_stages.h"

#include <catch2/catch.hpp>
#include <map>
#include <set>
#include <thread>

#include "bus/run/stage_memory.h"
#include "bus/run/stage_runner.h"
#include "bus/verify/verify.h"
#include "roadfix/stages.h"
#include "support/temporary_folder.h"

using namespace roadfix;
using namespace roadfix::test;

namespace {

constexpr unsigned kOrders = 200;

/// Every output and snapshot, byte for byte, one behind the other. A snapshot tells what has arrived and waits, too.
struct Published : MessageSink {
  std::vector<uint8_t> outputs;
  std::vector<uint8_t> states;
  int64_t messages = 0;
  void put(const std::string& channel, const Header&, std::span<const uint8_t> bytes) override {
    if (channel.starts_with("LEDGER_")) return;
    auto& to = channel.starts_with("STATE_") ? states : outputs;
    to.insert(to.end(), bytes.begin(), bytes.end());
    ++messages;
  }
};

Published run(const ShippedStage& stage, const Arrivals& arrivals) {
  Published published;
  StageRunner runner(stage.made(), published);
  for (const Delivery& d : deliveries(runner.spec(), stage.drive(), arrivals)) runner.offer(d.input, d.message->bytes);
  return published;
}

/// With a stage of another calibration, where one is given.
StageVerdict verdict(const ShippedStage& stage, std::span<const LoggedEvent> events,
                     const std::optional<Calibration>& here = std::nullopt) {
  const TemporaryFolder folder;
  write_events(folder / "drive.lcm", events);
  return verify({folder / "drive.lcm"}, {[&] { return stage.make(here.value_or(stage.calibration)); }}).stages.at(0);
}

void require_orders_alike(const ShippedStage& stage) {
  const Published expected = run(stage, {});
  REQUIRE(expected.messages > 50);
  REQUIRE(!expected.states.empty());
  for (unsigned seed = 1; seed <= kOrders; ++seed) {
    CAPTURE(stage.title, seed);
    REQUIRE(run(stage, {.seed = seed, .duplicates = seed % 2 == 0}).outputs == expected.outputs);
  }
  // The comparison can fail: beyond the lateness inputs are refused, and that shows.
  REQUIRE(run(stage, {.seed = 1, .extra_us = 300'000}).outputs != expected.outputs);
}

}  // namespace

TEST_CASE("every stage of the program is among the shipped ones of these tests") {
  std::set<std::string> tested;
  for (const ShippedStage& stage : shipped_stages()) tested.insert(stage.made()->spec().name);
  for (const std::string& name : stage_names()) REQUIRE(tested.contains(name));
}

TEST_CASE("every input of a stage is in one of the drives of these tests, but those that only a running car has") {
  std::map<std::string, std::set<std::string>> wanted, driven;
  for (const ShippedStage& stage : shipped_stages()) {
    const StageSpec spec = stage.made()->spec();
    for (const InputSpec& input : spec.inputs) wanted[spec.name].insert(input.channel);
    for (const DriveMessage& message : stage.drive()) driven[spec.name].insert(message.channel);
  }
  for (const auto& [name, channels] : wanted) {
    for (const std::string& channel : channels) {
      if (channel.starts_with("START_") || channel.starts_with("HORIZON_")) continue;  // resume_test, horizon_test
      CAPTURE(name, channel);
      CHECK(driven[name].contains(channel));
    }
  }
}

// Each a test of its own, so that they run beside each other.
TEST_CASE(
    "200 orders of arrival within the lateness, half of them with duplicates: gnss_ins_ekf gives the same bytes") {
  require_orders_alike(shipped_stages()[0]);
}
TEST_CASE("200 orders of arrival within the lateness, half of them with duplicates: wheel_odometry does") {
  require_orders_alike(shipped_stages()[1]);
}
TEST_CASE("200 orders of arrival within the lateness, half of them with duplicates: imm_fusion does") {
  require_orders_alike(shipped_stages()[2]);
}
TEST_CASE("200 orders of arrival within the lateness, half of them with duplicates: integrity does") {
  require_orders_alike(shipped_stages()[3]);
}
TEST_CASE("200 orders of arrival within the lateness, half of them with duplicates: vo_tracker does") {
  require_orders_alike(shipped_stages()[4]);
}
TEST_CASE("200 orders of arrival within the lateness, half of them with duplicates: vo_tracker in mode filter does") {
  require_orders_alike(shipped_stages()[5]);
}

TEST_CASE("200 orders of arrival within the lateness, half of them with duplicates: the navigation filter does") {
  require_orders_alike(shipped_stages()[6]);
}

TEST_CASE("four stages beside each other in threads: the same bytes as alone") {
  for (const ShippedStage& stage : shipped_stages()) {
    CAPTURE(stage.title);
    const Arrivals arrivals{.seed = 5};
    const Published alone = run(stage, arrivals);
    std::vector<Published> beside(4);
    std::vector<std::thread> threads;
    for (Published& published : beside) threads.emplace_back([&] { published = run(stage, arrivals); });
    for (std::thread& thread : threads) thread.join();
    for (const Published& published : beside) {
      REQUIRE(published.outputs == alone.outputs);
      REQUIRE(published.states == alone.states);
    }
  }
}

TEST_CASE("each stage verifies, and one value of the calibration changed is named") {
  for (const ShippedStage& stage : shipped_stages()) {
    CAPTURE(stage.title);
    const std::vector<LoggedEvent> log = record(stage);
    const StageVerdict same = verdict(stage, log);
    REQUIRE(same.identical() > 50);
    REQUIRE(same.differing() + same.unverifiable() == 0);
    REQUIRE(same.config_differences.empty());
    Calibration changed = stage.calibration;
    changed.sensors.imu->gyro_noise = 0.0123;
    const StageVerdict other = verdict(stage, log, changed);
    REQUIRE(other.config_differences.size() == 1);
    REQUIRE_THAT(other.config_differences[0],
                 Catch::Contains("calibration: ") && Catch::Contains("gyro_noise_radps_per_rthz: 0.0123' here"));
  }
}

TEST_CASE("IMU samples without numbers: no stale pose goes out under a new stamp as valid") {
  struct Poses : MessageSink {
    std::vector<pose_t> all;
    void put(const std::string& channel, const Header&, std::span<const uint8_t> bytes) override {
      if (channel == "POSE_INS") all.push_back(decode<pose_t>(bytes));
    }
  } poses;
  const ShippedStage& stage = shipped_stages()[0];
  std::vector<DriveMessage> drive = stage.drive();
  const int64_t begin = drive.front().header.utime;
  const auto broken = [&](int64_t utime) { return utime > begin + 14'000'000 && utime <= begin + 15'500'000; };
  for (DriveMessage& m : drive) {
    if (m.channel != "IMU" || !broken(m.header.utime)) continue;
    auto imu = decode<imu_t>(m.bytes);
    imu.accel_mps2[0] = std::numeric_limits<double>::quiet_NaN();
    m.bytes = encode(imu);
  }
  StageRunner runner(stage.made(), poses);
  for (const Delivery& d : deliveries(runner.spec(), drive)) runner.offer(d.input, d.message->bytes);
  int64_t before = 0, within = 0, after = 0;
  for (const pose_t& pose : poses.all) {
    if (pose.validity == pose_t::VALIDITY_INVALID) continue;
    (broken(pose.utime) ? within : pose.utime > begin + 15'500'000 ? after : before) += 1;
  }
  CHECK(before > 500);
  CHECK(within == 0);
  CHECK(after > 200);
}

TEST_CASE("a recording of each stage begun in mid-drive: nothing differs from the first snapshot on") {
  for (const ShippedStage& stage : shipped_stages()) {
    CAPTURE(stage.title);
    const std::vector<LoggedEvent> log = record(stage);
    const std::span<const LoggedEvent> late = std::span(log).subspan(log.size() / 20);
    const StageVerdict rest = verdict(stage, late);
    REQUIRE(rest.differing() == 0);
    REQUIRE(rest.identical() > 20);
    REQUIRE(rest.runs.at(0).resumed >= 1);
  }
}

TEST_CASE("the tracker publishes a snapshot where a map begins, also after a wish to start again") {
  const ShippedStage& tracker = shipped_stages()[4];
  std::vector<int64_t> snapshots;
  for (const LoggedEvent& event : record(tracker)) {
    if (event.channel == "STATE_VO_TRACKER") snapshots.push_back(event.header.utime - kDriveStart_us);
  }
  // The first pictures; the 9 s of data; the first frame half a second after the wish of 1.15 s.
  REQUIRE(snapshots == std::vector<int64_t>{0, 1'000'000, 1'700'000});
}

namespace {

/// What a stage remembers after its drive, where it began with `memory` (empty: with none).
std::vector<uint8_t> remembered(const ShippedStage& stage, const std::vector<uint8_t>& memory) {
  Published published;
  StageRunner runner(stage.made(), published);
  const StageSpec& spec = runner.spec();
  const std::vector<Delivery> all = deliveries(spec, stage.drive());
  if (!memory.empty()) {
    state_t start{};
    start.utime = all.front().message->header.utime - 250'000;
    start.run = start.utime;
    start.process = spec.name;
    start.layout = spec.state_layout;
    start.state = memory;
    start.size_bytes = static_cast<int32_t>(memory.size());
    const std::vector<uint8_t> bytes = encode(start);
    REQUIRE(memory_input(spec) >= 0);
    runner.offer(memory_input(spec), bytes);
  }
  for (const Delivery& delivery : all) runner.offer(delivery.input, delivery.message->bytes);
  return runner.stage().memory();
}

}  // namespace

TEST_CASE("what a shipped stage remembers comes back through its START input") {
  int with_memory = 0;
  for (const ShippedStage& stage : shipped_stages()) {
    CAPTURE(stage.title);
    std::vector<uint8_t> memory = remembered(stage, {});
    if (memory.empty()) continue;  // nothing worth keeping after so short a drive
    ++with_memory;
    const std::vector<uint8_t> cold = memory;
    REQUIRE(remembered(stage, memory) != cold);
    // Another version's bytes are not taken for numbers.
    memory.push_back(0);
    REQUIRE(remembered(stage, memory) == cold);
  }
  REQUIRE(with_memory > 0);
}
