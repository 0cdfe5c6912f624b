#include "roadfix/fleet/drive_words.h"

#include <catch2/catch.hpp>
#include <fstream>

#include "support/temporary_folder.h"

using namespace roadfix;
using Catch::Matchers::Contains;

namespace {

using Words = std::vector<std::string>;

/// A folder with logs a.lcm and b.lcm in logs/, and a recording.
class Storage {
 public:
  Storage() {
    for (const char* folder : {"logs", "drive"}) std::filesystem::create_directory(root_ / folder);
    for (const char* file : {"logs/b.lcm", "logs/a.lcm", "drive/drive.yaml"}) std::ofstream(root_ / file) << "x";
  }
  [[nodiscard]] const std::filesystem::path& root() const { return root_.path(); }
  [[nodiscard]] std::vector<Words> expand(const Words& words) const { return expand_drive_words(words, root()); }
  void write(const std::string& name, const std::string& text) const { std::ofstream(root_ / name) << text; }

 private:
  test::TemporaryFolder root_;
};

}  // namespace

TEST_CASE("fleet: seeds and faults of a scenario make every pair of them") {
  const Storage storage;
  const auto drives =
      storage.expand({"city_loop", "seeds=3..4,9", "fault=none", "fault=gnss.silence@5+2/wheels.slip@9"});
  REQUIRE(drives.size() == 6);
  CHECK(drives[1] == Words{"city_loop", "seed=3", "fault=gnss.silence@5+2/wheels.slip@9"});
  const FleetDrive drive = parse_drive(drives[5], storage.root());
  CHECK(drive.kind == DriveKind::kScenario);
  CHECK(drive.seed == 9);
  CHECK(drive.scenario.faults == Words{"gnss.silence@5+2", "wheels.slip@9"});
  CHECK(parse_drive(drives[0], storage.root()).scenario.faults.empty());
}

TEST_CASE("fleet: a folder of logs is each of them, a recording is one drive a phase") {
  const Storage storage;
  const auto drives = storage.expand({"logs", "drive", "cut_gnss_s=60", "every_s=180", "phase_s=0,90"});
  REQUIRE(drives.size() == 4);
  CHECK(drives[0] == Words{"logs/a.lcm"});
  CHECK(drives[1] == Words{"logs/b.lcm"});
  const FleetDrive cut = parse_drive(drives[3], storage.root());
  CHECK(cut.kind == DriveKind::kRecording);
  CHECK(cut.path == storage.root() / "drive");
  CHECK(cut.changes.gnss.cut->length == 60.0);
  CHECK(cut.changes.gnss.cut->phase == 90.0);
}

TEST_CASE("fleet: a list file holds the same words, and its errors name the line") {
  const Storage storage;
  storage.write("list.txt", "# two kinds\nlogs/a.lcm\n\ncity_loop seeds=1..2 camera=none  # two more\n");
  CHECK(storage.expand({"@" + (storage.root() / "list.txt").string()}).size() == 3);
  storage.write("bad.txt", "logs/a.lcm\ncity_loop sede=1\n");
  CHECK_THROWS_WITH(storage.expand({"@" + (storage.root() / "bad.txt").string()}),
                    Contains("bad.txt:2: sede=1: no key of a scenario (seed, fault, duration_s"));
}

TEST_CASE("fleet: what is no drive, no key or no value is named before anything runs") {
  const Storage storage;
  CHECK_THROWS_WITH(storage.expand({"mars"}), Contains("mars: neither a scenario"));
  CHECK_THROWS_WITH(storage.expand({"seeds=1..3"}), Contains("no drive before it"));
  CHECK_THROWS_WITH(storage.expand({"logs/a.lcm", "seeds=1..3"}), Contains("no key of a log"));
  CHECK_THROWS_WITH(storage.expand({"drive", "fault=gnss.silence@3"}), Contains("no key of a recording"));
  CHECK_THROWS_WITH(storage.expand({"drive", "cut_gnss_s=60"}), Contains("go together"));
  CHECK_THROWS_WITH(storage.expand({"city_loop", "fault=none", "fault=gnss.joke@3"}),
                    Contains("no fault of this name"));
  CHECK_THROWS_WITH(storage.expand({"city_loop", "camera=three"}), Contains("must be none, mono or stereo"));
  CHECK_THROWS_WITH(storage.expand({"city_loop", "duration_s=nan"}), Contains("must be a number"));
  CHECK_THROWS_WITH(storage.expand({"city_loop", "duration_s=1", "duration_s=2"}), Contains("stands there twice"));
  CHECK_THROWS_WITH(storage.expand({"logs/a.lcm", "logs"}), Contains("named twice"));
  for (const std::string seeds : {"", "x", "3..1", "1..2000000", "-1", "1,,2", "1..", "0x1"}) {
    CHECK_THROWS_WITH(parse_number_list(seeds), Contains("must be numbers like"));
  }
}
