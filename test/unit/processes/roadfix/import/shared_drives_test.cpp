// Every recording of ../shared/data is imported, where it is.
#include <catch2/catch.hpp>
#include <map>

#include "bus/log/log_reader.h"
#include "roadfix/import/drive_folder.h"
#include "roadfix/import/drive_log.h"
#include "roadfix/import/source.h"
#include "support/shared_data.h"
#include "support/temporary_folder.h"

namespace roadfix {
namespace {

struct Imported {
  std::map<std::string, int> counts;
  DriveFacts facts;
};

Imported import(const std::filesystem::path& source, const ImportChanges& changes = {},
                const std::string& sequence = "") {
  const test::TemporaryFolder folder;
  const auto log = folder / "drive.lcm";
  Imported imported;
  imported.facts =
      write_drive_log(read_source(source, {detect_format(source), sequence, {}, {}}), changes, log, {}).facts;
  LogReader reader(log);
  while (const auto event = reader.next()) ++imported.counts[std::string(event->channel)];
  CHECK(reader.damage().empty());
  return imported;
}

TEST_CASE("adis_semisim is imported") {
  const auto path = test::shared_path("data/adis_semisim");
  if (!path) return;
  const DriveFolder drive = read_drive_folder(*path);
  CHECK(drive.wheels.front().direction == WheelDirection::kSigned);
  CHECK(drive.description.windows.size() == 2);
  ImportChanges changes;
  changes.gnss.cut = CutGnss{30.0, 180.0, 300.0, 30.0};
  const Imported imported = import(*path, changes);
  CHECK(imported.counts.at("IMU") == 323189);
  CHECK(imported.counts.at("REFERENCE") == 16160);
  CHECK(imported.facts.outages.size() == 7);
  CHECK(imported.counts.at("GNSS") == 1615 - 7 * 30);
  CHECK(imported.facts.reference.attitude);
  CHECK_FALSE(imported.facts.reference.from_fixes);
}

TEST_CASE("car_0708 is imported") {
  const auto path = test::shared_path("data/car_0708");
  if (!path) return;
  ImportChanges changes;
  changes.gnss.keep_every = 4;
  const Imported imported = import(*path, changes);
  CHECK(imported.counts.at("GNSS") == 550);
  CHECK(imported.counts.at("REFERENCE") == 2197);
  CHECK(imported.facts.reference.from_fixes);
  CHECK(imported.facts.score_withheld_only);
  CHECK(imported.facts.score.fix_types == std::vector<FixType>{FixType::kRtkFixed});
}

TEST_CASE("malaga07_part1 is imported") {
  const auto path = test::shared_path("data/malaga07_part1");
  if (!path) return;
  const Imported imported = import(*path);
  CHECK(imported.counts.at("CAMERA_LEFT") == 530);
  CHECK(imported.counts.at("REFERENCE") == 53);
  CHECK(imported.facts.reference.of == ReferenceOf::kAntenna);
}

TEST_CASE("kitti_odometry_00_first200 is imported") {
  const auto path = test::shared_path("data/kitti_odometry_00_first200");
  if (!path) return;
  const Imported imported = import(*path);
  CHECK(imported.counts.at("CAMERA_LEFT") == 200);
  CHECK(imported.counts.at("CAMERA_RIGHT") == 100);
  CHECK(imported.counts.at("REFERENCE") == 200);
}

TEST_CASE("euroc_v101_first95 is imported") {
  const auto path = test::shared_path("data/euroc_v101_first95");
  if (!path) return;
  const Imported imported = import(*path);
  CHECK(imported.counts.at("CAMERA_LEFT") == 95);
  CHECK(imported.counts.at("IMU") == 1099);
}

TEST_CASE("both sequences of trajectories are imported") {
  const auto path = test::shared_path("data/trajectories");
  if (!path) return;
  CHECK(import(*path, {}, "kitti_00").counts.at("POSE_VO") == 4541);
  const Imported keyframes = import(*path, {}, "kitti_06");
  CHECK(keyframes.counts.at("POSE_VO") == 910);
  CHECK(keyframes.counts.at("REFERENCE") == 1101);
}

}  // namespace
}  // namespace roadfix
