// A drive folder's other units: counters in place of wheel speeds, deg/s and g in place of SI.
#include <fmt/format.h>
#include <catch2/catch.hpp>

#include "config/config_error.h"
#include "geometry/frames.h"
#include "roadfix/import/drive_folder.h"
#include "small_drive.h"

namespace roadfix {
namespace {

namespace fs = std::filesystem;

constexpr const char* kEncoder =
    "sensors: {wheels: {ticks_per_turn: 100, wheel_radius_m: 0.3, ticks_wrap_at: 1000, track_width_m: 1.5}}\n";
constexpr double kTickAt10Hz = 2.0 * kPi * 0.3 / 100.0 / 0.1;  // m/s

DriveFolder folder_of(const test::TemporaryFolder& folder, const std::string& yaml, const std::string& file,
                      const std::string& csv) {
  test::write_file(folder / "drive.yaml", yaml);
  test::write_file(folder / file, csv);
  return read_drive_folder(folder.path());
}

std::string error_of(const std::string& yaml, const std::string& csv) {
  const test::TemporaryFolder folder;
  try {
    folder_of(folder, yaml, "wheels.csv", csv);
  } catch (const ConfigError& e) {
    return e.what();
  }
  return "no error";
}

TEST_CASE("one counter on the axle gives speeds between its readings, over its wrap") {
  const test::TemporaryFolder folder;
  const auto drive =
      folder_of(folder, kEncoder, "wheels.csv",
                "utime_us,ticks\n1000000,985\n1100000,995\n1200000,5\n1300000,2\n5000000,0\n5100000,5\n");
  REQUIRE(drive.wheels.size() == 4);  // none over the gap
  CHECK(drive.wheels[0].t_us == 1050000);
  CHECK(drive.wheels[0].num_speeds == 1);
  CHECK(drive.wheels[0].speeds[0] == Approx(10.0 * kTickAt10Hz));
  CHECK(drive.wheels[1].speeds[0] == Approx(10.0 * kTickAt10Hz));
  CHECK(drive.wheels[2].speeds[0] == Approx(-3.0 * kTickAt10Hz));
  CHECK(drive.wheels[3].t_us == 5050000);
  CHECK(drive.wheels[0].direction == WheelDirection::kSigned);
  CHECK_FALSE(drive.wheels[0].yaw_rate.has_value());
  REQUIRE(drive.remarks.size() == 1);
  CHECK_THAT(drive.remarks[0], Catch::Contains("wheels are 1 counters: 4 speeds") && Catch::Contains("0.0188 m"));
}

TEST_CASE("two rear counters give the axle's speed, and its yaw rate where the track is known") {
  const std::string csv = "utime_us,rear_left_ticks,rear_right_ticks\n1000000,0,0\n1100000,10,14\n";
  const test::TemporaryFolder folder;
  const auto drive = folder_of(folder, kEncoder, "wheels.csv", csv);
  REQUIRE(drive.wheels.size() == 1);
  CHECK(drive.wheels[0].num_speeds == 1);
  CHECK(drive.wheels[0].speeds[0] == Approx(12.0 * kTickAt10Hz));
  CHECK(*drive.wheels[0].yaw_rate == Approx(4.0 * kTickAt10Hz / 1.5));  // the right wheel goes further: to the left
  const test::TemporaryFolder other;
  const auto without =
      folder_of(other, "sensors: {wheels: {ticks_per_turn: 100, wheel_radius_m: 0.3}}\n", "wheels.csv", csv);
  CHECK_FALSE(without.wheels[0].yaw_rate.has_value());
  CHECK_THAT(without.remarks.back(), Catch::Contains("no yaw rate") && Catch::Contains("sensors.wheels.track_width_m"));
}

TEST_CASE("four counters give four speeds") {
  const test::TemporaryFolder folder;
  const auto drive = folder_of(folder, kEncoder, "wheels.csv",
                               "utime_us,front_left_ticks,front_right_ticks,rear_left_ticks,rear_right_ticks\n"
                               "1000000,0,10,20,30\n1100000,1,12,23,34\n");
  REQUIRE(drive.wheels.size() == 1);
  CHECK(drive.wheels[0].num_speeds == 4);
  CHECK(drive.wheels[0].speeds[3] == Approx(4.0 * kTickAt10Hz));
}

TEST_CASE("counters that cannot be are told with the key that is missing") {
  const std::string two_rows = "utime_us,ticks\n1000000,1\n1100000,2\n";
  CHECK_THAT(error_of("name: x\n", two_rows),
             Catch::Contains("drive.yaml must say sensors.wheels.ticks_per_turn and wheel_radius_m"));
  CHECK_THAT(error_of("sensors: {wheels: {ticks_per_turn: 100}}\n", two_rows), Catch::Contains("wheel_radius_m"));
  CHECK_THAT(error_of("sensors: {wheels: {ticks_per_turn: 0}}\n", two_rows), Catch::Contains("ticks_per_turn = 0"));
  const std::string unwrapped = "sensors: {wheels: {ticks_per_turn: 100, wheel_radius_m: 0.3}}\n";
  CHECK_THAT(error_of(unwrapped, "utime_us,ticks\n1000000,65530\n1100000,4\n"),
             Catch::Contains("wheels.csv:3: ticks = 4: is -12351 m/s since the row before") &&
                 Catch::Contains("ticks_wrap_at tells where"));
  CHECK_THAT(error_of(kEncoder, "utime_us,ticks\n1000000,1000\n"), Catch::Contains("ticks = 1000: is out of range"));
  CHECK_THAT(error_of(kEncoder, "utime_us,ticks\n1000000,1.5\n"), Catch::Contains("wheels.csv:2: ticks = 1.5"));
  CHECK_THAT(error_of(kEncoder, "utime_us,ticks\n1000000,1\n1000000,2\n"), Catch::Contains("two readings of one time"));
  CHECK_THAT(error_of(kEncoder, "utime_us,ticks\n1000000,1\n"), Catch::Contains("has no two readings within a second"));
  CHECK_THAT(error_of(kEncoder, "utime_us,ticks,speed_mps\n1,1,1\n"), Catch::Contains("speeds or counters, not both"));
  CHECK_THAT(error_of(kEncoder, "utime_us,ticks,rear_left_ticks,rear_right_ticks\n1,1,1,1\n"),
             Catch::Contains("counters are ticks alone"));
  CHECK_THAT(error_of(kEncoder, "utime_us,rear_left_ticks\n1,1\n"), Catch::Contains("rear_right_ticks is missing"));
}

TEST_CASE("an IMU in deg/s and g is the same as in SI") {
  const test::TemporaryFolder folder;
  const auto drive = folder_of(folder, "name: x\n", "imu.csv",
                               "utime_us,gyro_x_degps,gyro_y_degps,gyro_z_degps,accel_x_g,accel_y_g,accel_z_g\n"
                               "1000000,180,-90,0,0,0.5,1\n");
  REQUIRE(drive.imu.size() == 1);
  CHECK((drive.imu[0].gyro - Eigen::Vector3d(kPi, -kPi / 2.0, 0.0)).norm() < 1e-12);
  CHECK((drive.imu[0].accel - Eigen::Vector3d(0.0, 4.903325, 9.80665)).norm() < 1e-12);
}

}  // namespace
}  // namespace roadfix
