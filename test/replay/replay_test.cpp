#include "bus/run/replay.h"

#include <catch2/catch.hpp>
#include <fstream>
#include <iterator>
#include <random>

#include "bus/log/stray_stamps.h"
#include "support/chain_stage.h"
#include "support/small_drive.h"
#include "support/temporary_folder.h"

using namespace roadfix;
using namespace roadfix::test;

namespace {

std::string read_bytes(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::vector<std::unique_ptr<Stage>> stages(const std::vector<StageSpec>& specs) {
  std::vector<std::unique_ptr<Stage>> made;
  for (const StageSpec& spec : specs) made.push_back(std::make_unique<ChainStage>(spec));
  return made;
}

/// Channel and data of every event, in file order.
std::vector<std::pair<std::string, std::string>> events(const std::filesystem::path& path, const std::string& prefix) {
  LogReader reader(path);
  std::vector<std::pair<std::string, std::string>> found;
  while (const auto event = reader.next()) {
    if (event->channel.starts_with(prefix)) {
      found.emplace_back(event->channel, std::string(event->data.begin(), event->data.end()));
    }
  }
  return found;
}

}  // namespace

TEST_CASE("two replays are byte-identical, whatever the order of the input file") {
  TemporaryFolder folder;
  std::vector<DriveMessage> drive = small_drive(20.0);
  write_drive(folder / "in.lcm", drive);
  const std::vector<StageSpec> specs = {odometry_spec(), filter_spec(), fusion_spec()};
  const ReplaySummary summary = replay(folder / "in.lcm", folder / "a.lcm", stages(specs));
  replay(folder / "in.lcm", folder / "b.lcm", stages(specs));
  std::mt19937 random(3);
  std::shuffle(drive.begin(), drive.end(), random);
  write_drive(folder / "shuffled.lcm", drive);
  replay(folder / "shuffled.lcm", folder / "c.lcm", stages(specs));
  const std::string a = read_bytes(folder / "a.lcm");
  REQUIRE(a.size() > 100'000);
  REQUIRE(a == read_bytes(folder / "b.lcm"));
  REQUIRE(a == read_bytes(folder / "c.lcm"));
  REQUIRE(events(folder / "a.lcm", "POSE_FUSED").size() == 2000);
  for (const ReplaySummary::Input& input : summary.inputs) {
    CAPTURE(input.stage, input.channel);
    CHECK(input.counters.late + input.counters.lost + input.counters.refused + input.counters.duplicate == 0);
  }

  drive.pop_back();  // the comparison can fail
  write_drive(folder / "fewer.lcm", drive);
  replay(folder / "fewer.lcm", folder / "d.lcm", stages(specs));
  REQUIRE(a != read_bytes(folder / "d.lcm"));
}

TEST_CASE("stage by stage gives what all stages at once give") {
  TemporaryFolder folder;
  write_drive(folder / "in.lcm", small_drive(20.0));
  replay(folder / "in.lcm", folder / "all.lcm", stages({odometry_spec(), filter_spec(), fusion_spec()}));

  ReplayOptions keep;
  keep.copied_channels = {"IMU", "GNSS", "WHEELS", "POSE_WHEEL", "POSE_INS"};
  replay(folder / "in.lcm", folder / "one.lcm", stages({odometry_spec()}), keep);
  replay(folder / "one.lcm", folder / "two.lcm", stages({filter_spec()}), keep);
  replay(folder / "two.lcm", folder / "three.lcm", stages({fusion_spec()}), keep);
  const auto fused = events(folder / "all.lcm", "POSE_FUSED");
  REQUIRE(fused.size() == 2000);
  REQUIRE(fused == events(folder / "three.lcm", "POSE_FUSED"));
  REQUIRE(events(folder / "all.lcm", "POSE_INS") == events(folder / "three.lcm", "POSE_INS"));
}

TEST_CASE("a replay begun at snapshots writes what the whole one writes from there on") {
  TemporaryFolder folder;
  write_drive(folder / "in.lcm", small_drive(40.0));
  const std::vector<StageSpec> specs = {odometry_spec(), filter_spec(), fusion_spec()};
  ReplayOptions options;
  options.copied_channels = {"IMU", "GNSS", "WHEELS"};
  replay(folder / "in.lcm", folder / "whole.lcm", stages(specs), options);
  options.from_s = 25.0;
  replay(folder / "whole.lcm", folder / "rest.lcm", stages(specs), options);
  replay(folder / "whole.lcm", folder / "fusion.lcm", stages({fusion_spec()}), options);
  for (const std::string channel : {"POSE_WHEEL", "POSE_INS", "POSE_FUSED", "STATE_FUSION"}) {
    CAPTURE(channel);
    const auto whole = events(folder / "whole.lcm", channel);
    const auto rest = events(folder / "rest.lcm", channel);
    REQUIRE(!rest.empty());
    REQUIRE(rest.size() < whole.size());
    REQUIRE(std::equal(rest.rbegin(), rest.rend(), whole.rbegin()));
  }
  REQUIRE(events(folder / "rest.lcm", "POSE_FUSED").size() > 1500);
  REQUIRE(events(folder / "rest.lcm", "POSE_FUSED") == events(folder / "fusion.lcm", "POSE_FUSED"));
  options.from_s = 0.5;
  REQUIRE_THROWS_WITH(replay(folder / "whole.lcm", folder / "none.lcm", stages(specs), options),
                      Catch::Contains("no snapshot of odometry"));
}

TEST_CASE("output events are in the order of utime, channel and seq, stamped with message time") {
  TemporaryFolder folder;
  write_drive(folder / "in.lcm", small_drive(5.0));
  replay(folder / "in.lcm", folder / "out.lcm", stages({odometry_spec(), filter_spec(), fusion_spec()}));
  LogReader reader(folder / "out.lcm");
  std::tuple<int64_t, std::string, int64_t> last{0, "", -1};
  int64_t eventnum = 0;
  while (const auto event = reader.next()) {
    const Header header = *read_header(event->data);
    REQUIRE(event->timestamp_us == header.utime);
    REQUIRE(event->eventnum == eventnum++);
    const std::tuple<int64_t, std::string, int64_t> key{header.utime, std::string(event->channel), header.seq};
    REQUIRE(last < key);
    last = key;
  }
  REQUIRE(events(folder / "out.lcm", "REFERENCE").size() == 50);
  REQUIRE(events(folder / "out.lcm", "CONFIG_DRIVE").size() == 1);
  REQUIRE(events(folder / "out.lcm", "IMU").empty());
}

TEST_CASE("the stages' own channels in the input are computed again, not taken") {
  TemporaryFolder folder;
  std::vector<DriveMessage> drive = small_drive(5.0);
  write_drive(folder / "in.lcm", drive);
  replay(folder / "in.lcm", folder / "clean.lcm", stages({filter_spec(), fusion_spec()}));
  drive.push_back(drive_message("POSE_INS", kDriveStart_us + 1'000'000, 7, pose_t{}));
  write_drive(folder / "in2.lcm", drive);
  replay(folder / "in2.lcm", folder / "out.lcm", stages({filter_spec(), fusion_spec()}));
  REQUIRE(read_bytes(folder / "clean.lcm") == read_bytes(folder / "out.lcm"));
}

TEST_CASE("a log without the stage's clock, or over itself, is an error that leaves nothing") {
  TemporaryFolder folder;
  write_drive(folder / "in.lcm", small_drive(1.0));
  using Catch::Contains;
  REQUIRE_THROWS_WITH(replay(folder / "in.lcm", folder / "out.lcm", stages({fusion_spec()})),
                      Contains("POSE_INS, POSE_WHEEL") && Contains("fusion"));
  REQUIRE_THROWS_AS(replay(folder / "in.lcm", folder / "in.lcm", stages({filter_spec()})), std::runtime_error);
  REQUIRE_THROWS_WITH(replay(folder / "absent.lcm", folder / "out.lcm", stages({filter_spec()})),
                      Contains("absent.lcm"));
  REQUIRE(std::distance(std::filesystem::directory_iterator(folder / ""), {}) == 1);
  std::filesystem::rename(folder / "in.lcm", folder / "killed.lcm.part");
  REQUIRE_THROWS_WITH(replay(folder / "killed.lcm.part", folder / "killed.lcm", stages({filter_spec()})),
                      Contains("would replace the input"));
  REQUIRE(events(folder / "killed.lcm.part", "IMU").size() == 100);
}

TEST_CASE("a log whose clock is of another type is an error, not an empty replay") {
  TemporaryFolder folder;
  std::vector<DriveMessage> drive = small_drive(1.0);
  for (DriveMessage& m : drive) {
    if (m.channel == "IMU") m = drive_message("IMU", m.header.utime, m.header.seq, gnss_t{});
  }
  write_drive(folder / "in.lcm", drive);
  REQUIRE_THROWS_WITH(replay(folder / "in.lcm", folder / "out.lcm", stages({filter_spec()})),
                      Catch::Contains("needs a message on IMU, and the log has none that can be decoded"));
}

TEST_CASE("damaged bytes in the input are counted and the rest is replayed") {
  TemporaryFolder folder;
  std::vector<DriveMessage> drive = small_drive(5.0);
  int damaged = 0;
  for (DriveMessage& message : drive) {
    if (message.channel == "GNSS" && message.header.seq == 7) {
      message.bytes.pop_back();
      ++damaged;
    }
  }
  REQUIRE(damaged == 1);
  write_drive(folder / "in.lcm", drive);
  const ReplaySummary summary = replay(folder / "in.lcm", folder / "out.lcm", stages({filter_spec()}));
  const InputCounters& gnss = summary.inputs.at(1).counters;
  REQUIRE(gnss.undecodable == 1);
  REQUIRE(gnss.lost == 1);
  REQUIRE(events(folder / "out.lcm", "POSE_INS").size() == 500);
}

TEST_CASE("where a log has no clock, its first damage is named, and it alone") {
  TemporaryFolder folder;
  std::vector<DriveMessage> drive = small_drive(3.0);
  std::erase_if(drive, [](const DriveMessage& m) { return m.channel == "IMU"; });
  write_drive(folder / "in.lcm", drive);
  std::string bytes = read_bytes(folder / "in.lcm");
  std::vector<std::size_t> offsets;
  {
    LogReader reader(folder / "in.lcm");
    while (const auto event = reader.next()) offsets.push_back(event->offset);
  }
  for (const std::size_t i : {10U, 20U, 30U}) bytes[offsets[i]] = 'x';
  std::ofstream(folder / "in.lcm", std::ios::binary) << bytes;
  const std::string first = "damaged at byte " + std::to_string(offsets[10]) + " ";
  const std::string second = std::to_string(offsets[20]);
  REQUIRE_THROWS_WITH(replay(folder / "in.lcm", folder / "out.lcm", stages({filter_spec()})),
                      Catch::Contains("needs a message on IMU") && Catch::Contains(first) &&
                          Catch::EndsWith("in 2 more places") && !Catch::Contains(second));
}

TEST_CASE("one stray stamp costs its own message and none of the others") {
  TemporaryFolder folder;
  const std::vector<DriveMessage> drive = small_drive(10.0);
  const auto count_of = [](const ReplaySummary& summary, const std::string& channel) {
    for (const ReplaySummary::Input& input : summary.inputs) {
      if (input.channel == channel) return input.counters;
    }
    return InputCounters{};
  };
  struct Stray {
    std::string channel;
    int64_t seq;
    int64_t utime;
  };
  constexpr int64_t kYear_us = 31'557'600'000'000;
  std::vector<Stray> strays;
  for (const int64_t utime :
       {int64_t{-5}, int64_t{0}, kDriveStart_us - 20 * kYear_us, kDriveStart_us + 1'000'000, kDriveStart_us + 9'000'000,
        kDriveStart_us + 60'000'000, kDriveStart_us + 20 * kYear_us}) {
    for (const int64_t part : {0, 3, 5}) {  // of ten of the drive
      strays.push_back({"IMU", part * 100, utime});
      strays.push_back({"GNSS", part * 4, utime});
    }
    strays.push_back({"IMU", 999, utime});
  }
  for (const Stray& stray : strays) {
    CAPTURE(stray.channel, stray.seq, stray.utime);
    std::vector<DriveMessage> hurt = drive;
    for (DriveMessage& m : hurt) {
      if (m.channel != stray.channel || m.header.seq != stray.seq) continue;
      if (stray.channel == "IMU") m = drive_message("IMU", stray.utime, stray.seq, decode<imu_t>(m.bytes));
      if (stray.channel == "GNSS") m = drive_message("GNSS", stray.utime, stray.seq, decode<gnss_t>(m.bytes));
    }
    write_drive(folder / "in.lcm", hurt);
    const ReplaySummary summary = replay(folder / "in.lcm", folder / "out.lcm", stages({filter_spec()}));
    const auto [lost, applied] = std::pair(count_of(summary, stray.channel).lost, count_of(summary, "IMU").applied);
    CHECK(lost <= 1);
    // The last 250 ms wait, and with them what a fix may be late.
    CHECK(applied >= 1000 - 26 - (stray.channel == "IMU" ? 1 : 0));
    CHECK(count_of(summary, "GNSS").applied >= 39 - (stray.channel == "GNSS" ? 1 : 0));
    CHECK(events(folder / "out.lcm", "POSE_INS").size() >= (stray.channel == "IMU" ? 999U : 1000U));
    if (stray.utime != kDriveStart_us + 60'000'000) CHECK(summary.data_s == Approx(10.0).margin(0.1));
  }
}

TEST_CASE("stamps that are wrong by the many are left to the stage") {
  std::vector<Stamp> twice;  // a drive that is in the log twice
  for (int64_t i = 0; i < 100; ++i) twice.push_back({1, i % 50, i});
  const auto none = [](const std::vector<StampError>& errors) {
    return std::count(errors.begin(), errors.end(), StampError::kNone) == static_cast<int64_t>(errors.size());
  };
  CHECK(none(stray_stamps(twice)));
  CHECK_FALSE(none(stamp_errors(twice)));
  std::vector<Stamp> right;
  for (int64_t i = 0; i < 100; ++i) right.push_back({i / 50, i % 50, 1000 * i});
  std::swap(right[10], right[90]);  // their order says nothing
  CHECK(none(stamp_errors(right)));
  right[40].utime -= 20'000;
  right[45].utime += 3'000;
  const std::vector<StampError> errors = stray_stamps(right);
  CHECK(errors[40] == StampError::kEarly);
  CHECK(errors[45] == StampError::kLate);
  CHECK(std::count(errors.begin(), errors.end(), StampError::kNone) == 98);
  CHECK(none(stray_stamps(std::vector<Stamp>{{1, 0, 10}, {1, 1, 5}})));
}
