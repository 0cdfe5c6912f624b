// What a live stage decides by arrival, and what happens to it on the way: its recording verifies.
#include <catch2/catch.hpp>
#include <chrono>
#include <thread>

#include "support/recorded_stage.h"
#include "support/temporary_folder.h"

using namespace roadfix;
using namespace roadfix::test;

namespace {

/// Asks for a snapshot every 7 s, where the spec lets it.
class AskingStage : public ChainStage {
 public:
  using ChainStage::ChainStage;
  void publish(int64_t now_utime, Outputs& outputs) override {
    ChainStage::publish(now_utime, outputs);
    wants_ = now_utime % 7'000'000 == 0;
  }
  bool wants_snapshot() const override { return wants_; }

 private:
  bool wants_ = false;
};

}  // namespace

TEST_CASE("an overloaded stage skips all but the newest, says so, and verify obeys") {
  StageSpec spec = filter_spec();
  spec.overload = {{0}, 2};
  Recorder recorder(maker(spec));
  std::mt19937 random(4);
  std::size_t burst = 1;
  for (const DriveMessage& message : small_drive(40.0)) {
    recorder.play(message);
    if (--burst > 0) continue;
    recorder.step();
    burst = 1 + random() % 12;
  }
  recorder.step();
  recorder.stop();
  const InputCounters& imu = recorder.live().runner().stream().track(0).counters;
  REQUIRE(imu.skipped > 1000);
  REQUIRE(imu.lost == 0);
  REQUIRE(recorder.live().runner().stream().track(1).counters.skipped == 0);
  require_all_identical(recorder.verdict(), 700);
  const heartbeat_t last = recorder.last_heartbeat();
  REQUIRE(last.input_skipped.at(0) == imu.skipped);
  REQUIRE_THAT(last.state_reason, Catch::Contains("IMU: too fast"));
}

TEST_CASE("snapshots at the stage's own request: verify and a recording begun late go on from them") {
  StageSpec spec = filter_spec();
  spec.snapshots = Snapshots::kOnRequest;
  Recorder recorder(maker<AskingStage>(spec));
  recorder.play_all(small_drive(40.0));
  std::vector<int64_t> states;
  for (const LoggedEvent& event : recorder.log()) {
    if (event.channel == "STATE_FILTER") states.push_back(event.header.utime);
  }
  REQUIRE(states.size() >= 5);
  for (const int64_t utime : states) REQUIRE(utime % 7'000'000 == 0);
  require_all_identical(recorder.verdict(), 4000);

  const TemporaryFolder folder;
  const std::span<const LoggedEvent> events(recorder.log());
  write_events(folder / "late.lcm", events.subspan(events.size() / 2));
  const StageVerdict late = verify({folder / "late.lcm"}, {maker<AskingStage>(spec)}).stages.at(0);
  REQUIRE(late.differing() == 0);
  REQUIRE(late.identical() > 1000);
  REQUIRE(late.runs.at(0).resumed >= 1);
}

TEST_CASE("a log played again: the stage begins a new run and says so, and each run verifies") {
  Recorder recorder(maker(filter_spec()));
  const std::vector<DriveMessage> drive = small_drive(20.0);
  for (int i = 0; i < 3; ++i) recorder.play_all(drive);
  recorder.stop();
  REQUIRE_THAT(recorder.last_heartbeat().state_reason, Catch::Contains("the stamps went back by 19 s: a new run"));
  const StageVerdict verdict = recorder.verdict();
  REQUIRE(verdict.runs.size() == 3);
  require_all_identical(verdict, 3 * 1900);
}

TEST_CASE("a log played again with shifted stamps and its old names is refused and said") {
  Recorder recorder(maker(filter_spec()));
  const std::vector<DriveMessage> drive = small_drive(20.0);
  recorder.play_all(drive);
  recorder.play_all(shifted(drive, 20'000'000, 0));
  recorder.stop();
  REQUIRE_THAT(recorder.last_heartbeat().state_reason, Catch::Contains("IMU: two publishers, or a log played again"));
  std::this_thread::sleep_for(std::chrono::milliseconds(1100));  // what is over is told no more, and that at once
  recorder.step();
  recorder.stop();
  REQUIRE(recorder.last_heartbeat().state_reason.find("two publishers") == std::string::npos);
  const StageVerdict verdict = recorder.verdict();
  REQUIRE(verdict.runs.size() == 1);
  require_all_identical(verdict, 2000);
}

TEST_CASE("drivers started anew, the clock's among them: one run of the stage goes on") {
  Recorder recorder(maker(filter_spec()));
  const std::vector<DriveMessage> drive = small_drive(20.0);
  recorder.play_all(drive);
  recorder.play_all(shifted(drive, 23'000'000, 23'000'000));
  recorder.stop();
  REQUIRE(recorder.last_heartbeat().state_reason.empty());
  const StageVerdict verdict = recorder.verdict();
  REQUIRE(verdict.runs.size() == 1);
  require_all_identical(verdict, 4000);
}

TEST_CASE("a stage that dies soon after a driver was started anew: the older run's numbers are not the newer's") {
  Recorder recorder(maker(filter_spec()));
  std::vector<DriveMessage> drive = small_drive(20.0);
  const std::vector<DriveMessage> again = shifted(small_drive(5.0), 15'000'000, 15'000'000);
  std::erase_if(drive, [](const DriveMessage& m) { return m.channel == "WHEELS" && m.header.seq >= 750; });
  for (const DriveMessage& m : again) {
    if (m.channel == "WHEELS") drive.push_back(m);
  }
  std::stable_sort(drive.begin(), drive.end(),
                   [](const DriveMessage& a, const DriveMessage& b) { return a.header.utime < b.header.utime; });
  recorder.play_all(drive);
  require_all_identical(recorder.verdict(), 1999);  // not stopped: the ledger ends where it was killed
}

TEST_CASE("a clock put ahead and back within a driver's run: each run of the stage has its own part of it") {
  Recorder recorder(maker(filter_spec()));
  const std::vector<DriveMessage> drive = small_drive(30.0);
  const std::vector<DriveMessage> ahead = shifted(drive, 60'000'000, 0);
  for (std::size_t i = 0; i < drive.size(); ++i) {
    const double t_s = static_cast<double>(drive[i].header.utime - kDriveStart_us) * 1e-6;
    recorder.play(t_s > 10.0 && t_s < 20.0 ? ahead[i] : drive[i]);
    recorder.step();
    if (i == drive.size() / 2) {
      recorder.stop();
      REQUIRE_THAT(recorder.last_heartbeat().state_reason, Catch::Contains("the stamps went ahead by 60 s: a new run"));
    }
  }
  const StageVerdict verdict = recorder.verdict();
  REQUIRE(verdict.runs.size() == 3);
  require_all_identical(verdict, 2900);

  // What the logger loses after that is no loss of the run that was ahead of it.
  const TemporaryFolder folder;
  std::vector<LoggedEvent> without = recorder.log();
  std::erase_if(without, [](const LoggedEvent& event) {
    return (event.channel == "IMU" && event.header.seq >= 2500 && event.header.seq < 2520) ||
           (event.channel == "GNSS" && event.header.seq == 104);
  });
  write_events(folder / "without.lcm", without);
  const StageVerdict lossy = verify({folder / "without.lcm"}, {maker(filter_spec())}).stages.at(0);
  REQUIRE(lossy.differing() == 0);
  REQUIRE(lossy.unverifiable() > 100);
  REQUIRE(lossy.runs.size() == 3);
  for (const RunVerdict& run : lossy.runs) {
    const bool ahead_of_it = run.run > kDriveStart_us + 60'000'000;
    if (ahead_of_it) REQUIRE((run.identical > 900 && run.unverifiable == 0 && run.losses.empty()));
  }
}

TEST_CASE("one stamp far ahead, or a broken message behind it, begins no new run") {
  Recorder recorder(maker(filter_spec()));
  std::vector<DriveMessage> drive = small_drive(10.0);
  const std::vector<DriveMessage> ahead = shifted(drive, 60'000'000, 0);
  for (std::size_t i = 0; i < drive.size(); ++i) {
    if (i == 900 || i == 1100) recorder.play(ahead[i + 200]);
    if (i == 1100) {
      DriveMessage broken = ahead[i + 220];
      broken.bytes.pop_back();
      recorder.play(broken);
    }
    recorder.play(drive[i]);
    recorder.step();
  }
  const StageVerdict verdict = recorder.verdict();
  REQUIRE(verdict.runs.size() == 1);
  require_all_identical(verdict, 950);
}

TEST_CASE("two publishers on a channel, also on the clock: said, and what was computed verifies") {
  for (const std::string twice : {"IMU", "WHEELS"}) {
    CAPTURE(twice);
    Recorder recorder(maker(filter_spec()));
    const std::vector<DriveMessage> drive = small_drive(20.0);
    const std::vector<DriveMessage> other = shifted(drive, 3'000, 500);
    for (std::size_t i = 0; i < drive.size(); ++i) {
      recorder.play(drive[i]);
      if (drive[i].channel == twice && i > drive.size() / 3) recorder.play(other[i]);
      recorder.step();
    }
    recorder.stop();
    REQUIRE_THAT(recorder.last_heartbeat().state_reason, Catch::Contains(twice + ": two publishers"));
    require_all_identical(recorder.verdict(), 1900);
  }
}

TEST_CASE("a clock sample far in the future is refused and counted, and nothing stops") {
  Recorder recorder(maker(filter_spec()));
  const std::vector<DriveMessage> drive = small_drive(20.0);
  std::vector<DriveMessage> wild = drive;
  const auto broken = std::find_if(wild.begin(), wild.end(),
                                   [](const DriveMessage& m) { return m.channel == "IMU" && m.header.seq == 900; });
  const int64_t year_us = int64_t{31'557'600} * 1'000'000;
  *broken = shifted({*broken}, year_us, 0)[0];
  recorder.play_all(wild);
  recorder.stop();
  const InputCounters& imu = recorder.live().runner().stream().track(0).counters;
  REQUIRE(imu.refused == 1);
  REQUIRE(imu.applied > 1900);
  require_all_identical(recorder.verdict(), 1999);
}

TEST_CASE("a stage whose very first sample was far in the future begins again when true ones come") {
  Recorder recorder(maker(filter_spec()));
  std::vector<DriveMessage> drive = small_drive(20.0);
  const auto first = std::find_if(drive.begin(), drive.end(), [](const DriveMessage& m) { return m.channel == "IMU"; });
  *first = shifted({*first}, 3'600'000'000, 0)[0];
  recorder.play_all(drive);
  recorder.stop();
  const StageVerdict verdict = recorder.verdict();
  REQUIRE(verdict.runs.size() == 2);
  require_all_identical(verdict, 1950);
}

namespace {

/// Begins with what it knew when it was stopped.
class RememberingStage : public ChainStage {
 public:
  using ChainStage::ChainStage;
  void apply(const Message& message) override {
    if (message.input != 3) return ChainStage::apply(message);
    const auto memory = decode<state_t>(message.bytes);
    ChainStage::load(memory.state);
  }
  std::vector<uint8_t> memory() const override { return save(); }
};

StageSpec remembering_spec() {
  StageSpec spec = filter_spec();
  spec.inputs.push_back({"START_FILTER", "state_t"});
  return spec;
}

}  // namespace

TEST_CASE("what a stage remembers across ignition is published, recorded, and verified like any input") {
  const TemporaryFolder folder;
  const std::filesystem::path memory = folder / "filter.state";
  const std::vector<DriveMessage> drive = small_drive(20.0);
  {
    Recorder first(maker<RememberingStage>(remembering_spec()), memory);
    first.play_all(drive);
    first.stop();
    REQUIRE(first.live().runner().stream().track(3).counters.received == 0);
    require_all_identical(first.verdict(), 2000);
  }
  Recorder second(maker<RememberingStage>(remembering_spec()), memory);
  second.play_all(shifted(drive, 3'600'000'000, 3'600'000'000));
  second.stop();
  REQUIRE(second.live().runner().stream().track(3).counters.applied == 1);
  require_all_identical(second.verdict(), 2000);
  const auto first_pose = std::find_if(second.log().begin(), second.log().end(),
                                       [](const LoggedEvent& event) { return event.channel == "POSE_INS"; });
  REQUIRE(decode<pose_t>(first_pose->bytes).position_m[1] > 1000.0);  // its count went on

  std::vector<LoggedEvent> without = second.log();
  REQUIRE(std::erase_if(without, [](const LoggedEvent& event) { return event.channel == "START_FILTER"; }) == 1);
  write_events(folder / "without.lcm", without);
  const StageVerdict lost =
      verify({folder / "without.lcm"}, {maker<RememberingStage>(remembering_spec())}).stages.at(0);
  REQUIRE(lost.differing() == 0);
  REQUIRE(lost.identical() > 900);  // from the first snapshot on
  REQUIRE(lost.unverifiable() <= 1000);
}

TEST_CASE("a memory that is damaged or of another stage is refused") {
  const TemporaryFolder folder;
  state_t memory{};
  memory.process = "filter";
  memory.layout = 1;
  const StageSpec spec = remembering_spec();
  REQUIRE_FALSE(read_memory(folder / "absent.state", spec));
  write_memory(folder / "a.state", memory);
  REQUIRE(read_memory(folder / "a.state", spec)->process == "filter");
  std::filesystem::resize_file(folder / "a.state", 40);
  REQUIRE_THROWS_WITH(read_memory(folder / "a.state", spec), Catch::Contains("damaged"));
  memory.process = "fusion";
  write_memory(folder / "a.state", memory);
  REQUIRE_THROWS_WITH(read_memory(folder / "a.state", spec), Catch::Contains("fusion"));
  REQUIRE_THROWS_AS(write_memory(folder / "no/such/folder", memory), std::runtime_error);
}
