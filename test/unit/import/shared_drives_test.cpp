// The drive folders of ../shared/data are read, where they are.
#include <catch2/catch.hpp>

#include "roadfix/import/drive_folder.h"
#include "support/shared_data.h"

namespace roadfix {
namespace {

TEST_CASE("adis_semisim is read") {
  const auto path = test::shared_path("data/adis_semisim");
  if (!path) return;
  const DriveFolder drive = read_drive_folder(*path);
  CHECK(drive.imu.size() > 300000);
  CHECK(drive.gnss.size() == 1615);
  CHECK(drive.wheels.front().direction == WheelDirection::kSigned);
  CHECK(drive.reference.front().q_enu_body.has_value());
  CHECK(drive.description.windows.size() == 2);
}

TEST_CASE("car_0708 is read") {
  const auto path = test::shared_path("data/car_0708");
  if (!path) return;
  const DriveFolder drive = read_drive_folder(*path);
  CHECK(drive.gnss.size() == 2197);
  CHECK(drive.reference.size() == 2197);
  CHECK(drive.gnss.front().velocity.has_value());
  CHECK(drive.description.calibration.sensors.gnss->velocity_latency_std == 0.15);
}

TEST_CASE("malaga07_part1 is read") {
  const auto path = test::shared_path("data/malaga07_part1");
  if (!path) return;
  const DriveFolder drive = read_drive_folder(*path);
  CHECK(drive.frames_left.size() == 530);
  CHECK(drive.gnss.front().height_kind == HeightKind::kUnknown);
  CHECK(drive.reference.empty());
}

}  // namespace
}  // namespace roadfix
