// Drive folders: every file is read, and a broken copy of each file gives the error a user needs.
#include "roadfix/import/drive_folder.h"

#include <fmt/format.h>
#include <catch2/catch.hpp>

#include "config/config_error.h"
#include "cut_files.h"
#include "geometry/frames.h"
#include "roadfix/import/csv_reader.h"
#include "small_drive.h"

namespace roadfix {
namespace {

namespace fs = std::filesystem;

std::string error_of(const fs::path& folder) {
  try {
    read_drive_folder(folder);
  } catch (const ConfigError& e) {
    return e.what();
  }
  return "no error";
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  if (at == std::string::npos) throw std::runtime_error("the test's drive has no " + from);
  return text.replace(at, from.size(), to);
}

TEST_CASE("a small drive folder is read with every sensor") {
  const test::TemporaryFolder folder;
  test::write_small_drive(folder.path());
  const DriveFolder drive = read_drive_folder(folder.path());
  CHECK(drive.description.name == "small");
  CHECK(drive.description.calibration.sensors.gnss->lever_arm->z() == 1.0);
  CHECK(drive.description.windows.at(0).phases == std::vector<double>{0.0, 0.5});
  REQUIRE(drive.imu.size() == 60);
  CHECK(drive.imu[3].t_us == test::kSmallDriveStart + 150000);
  CHECK(drive.imu[3].gyro == Eigen::Vector3d(0.001, -0.002, 0.1));
  CHECK(drive.imu[3].accel == Eigen::Vector3d(0.03, 0.02, 9.81));
  REQUIRE(drive.gnss.size() == 12);
  const GnssFix& fix = drive.gnss[2];
  CHECK(fix.fix_type == FixType::kRtkFloat);
  CHECK(fix.height_kind == HeightKind::kEllipsoid);
  CHECK(fix.antenna.longitude == 11.5 * kDegree);
  CHECK(fix.cov_enu(2, 2) == Approx(0.0009));
  CHECK(fix.velocity->enu.y() == 10.0);
  CHECK(fix.velocity->cov_enu(1, 1) == Approx(0.0025));
  CHECK(fix.heading->heading == 2.5 * kDegree);
  CHECK(fix.num_satellites == 12);
  REQUIRE(drive.wheels.size() == 30);
  CHECK(drive.wheels[0].num_speeds == 4);
  CHECK(drive.wheels[0].speeds[1] == 10.2);
  CHECK(drive.wheels[0].yaw_rate == 0.01);
  CHECK(drive.wheels[0].direction == WheelDirection::kUnknown);
  CHECK(drive.mag.at(0).field.z() == Approx(-42.5e-6));
  CHECK(drive.frames_left.at(1).path.filename() == "l1.png");
  CHECK(drive.frames_right.size() == 2);
  REQUIRE(drive.reference.size() == 12);
  CHECK(drive.reference[0].q_enu_body->w() == Approx(0.70710678));
}

TEST_CASE("a packed file reads like a plain one, and line ends do not matter") {
  const test::TemporaryFolder folder;
  test::write_small_drive(folder.path());
  const auto plain = read_drive_folder(folder.path());
  const std::string imu = test::read_file(folder.path() / "imu.csv");
  fs::remove(folder.path() / "imu.csv");
  test::write_gzip(folder.path() / "imu.csv.gz", imu);
  std::string windows_gnss = "\xef\xbb\xbf";
  for (const char c : test::read_file(folder.path() / "gnss.csv"))
    windows_gnss += c == '\n' ? "\r\n" : std::string(1, c);
  test::write_file(folder.path() / "gnss.csv", windows_gnss + "\r\n\r\n");
  const auto packed = read_drive_folder(folder.path());
  REQUIRE(packed.imu.size() == plain.imu.size());
  CHECK(packed.imu.back().accel == plain.imu.back().accel);
  REQUIRE(packed.gnss.size() == plain.gnss.size());
  CHECK(packed.gnss.back().antenna.latitude == plain.gnss.back().antenna.latitude);
}

TEST_CASE("columns may come in any order and absent files are absent sensors") {
  const test::TemporaryFolder folder;
  test::write_file(folder.path() / "drive.yaml", "name: little\n");
  test::write_file(folder.path() / "wheels.csv", "speed_mps,utime_us\n-1.5,100\n2,200\n");
  const auto drive = read_drive_folder(folder.path());
  CHECK(drive.imu.empty());
  CHECK(drive.gnss.empty());
  REQUIRE(drive.wheels.size() == 2);
  CHECK(drive.wheels[0].t_us == 100);
  CHECK(drive.wheels[0].speeds[0] == -1.5);
  CHECK(drive.wheels[1].direction == WheelDirection::kSigned);
}

/// One edit of one file of the small drive and a part of the error it must give.
struct Break {
  const char* file;
  const char* from;
  const char* to;
  const char* error;
};

TEST_CASE("a broken copy of each file gives the error a user needs") {
  const std::vector<Break> breaks = {
      {"drive.yaml", "rate_hz: 20", "rate_khz: 20",
       "drive.yaml:5: sensors.imu.rate_khz is unknown, did you mean rate_hz?"},
      {"drive.yaml", "radps_per", "degps_per",
       "drive.yaml:5: sensors.imu.gyro_noise_degps_per_rthz is unknown, did you mean gyro_noise_radps_per_rthz?"},
      {"drive.yaml", "[2, 2, 1]", "[2, 2]", "drive.yaml:10: mounting.std_deg = a list: has 2 entries, must have 3"},
      {"drive.yaml", "of: imu", "of: wheel", "drive.yaml:11: reference.of = wheel: must be one of imu, "},
      {"drive.yaml", "[rtk_fixed]", "[rtk]", "drive.yaml:12: score.fix_types[0] = rtk: must be one of none, single"},
      {"drive.yaml", "length_s: 0.5, ", "", "drive.yaml:14: windows[0].length_s is missing"},
      {"drive.yaml", "every_s: 1", "every_s: 0.2", "windows[0].every_s = 0.2: must not be shorter than length_s"},
      {"drive.yaml", "origin", "mame: x\norigin", "drive.yaml:2: mame is unknown, did you mean name?"},
      {"drive.yaml", "reference: {of: imu, attitude: true, sigma_m: 0.01}", "",
       "reference.of must say what reference.csv is of"},
      {"imu.csv", "gyro_x_radps", "gyro_x_rads",
       "imu.csv:1: column gyro_x_rads is unknown, did you mean gyro_x_radps?"},
      {"imu.csv", "gyro_x_radps", "gyro_x_degps", "imu.csv:1: column gyro_x_radps is missing: gyro_x_radps, gyro_y_"},
      {"imu.csv", "gyro_x_radps,gyro_y_radps,gyro_z_radps,", "",
       "imu.csv:1: must have either gyro_x_radps, gyro_y_radps"},
      {"imu.csv", ",accel_z_mps2", "",
       "imu.csv:1: column accel_z_mps2 is missing: accel_x_mps2, accel_y_mps2, accel_z_mps2 come"},
      {"imu.csv", "gyro_y_radps", "gyro_x_radps", "imu.csv:1: column gyro_x_radps is there twice"},
      {"imu.csv", "0.03,0.02,9.81", "0.03,0.02", "imu.csv:5: has 6 fields, the header has 7: 1700000000150000,0.001"},
      {"imu.csv", "0.03,0.02,9.81", "0.03,nan,9.81", "imu.csv:5: accel_y_mps2 = nan: is not a finite number"},
      {"imu.csv", "0.03,0.02,9.81", "0.03,,9.81", "imu.csv:5: accel_y_mps2 = : is not a number"},
      {"imu.csv", "0.03,0.02,9.81", "0.03,1e400,9.81", "imu.csv:5: accel_y_mps2 = 1e400: is not a number"},
      {"imu.csv", "0.03,0.02,9.81", "0.03,0.02x,9.81", "imu.csv:5: accel_y_mps2 = 0.02x: is not a number"},
      {"imu.csv", "0.03,0.02,9.81", "0.03,0.02,9810",
       "imu.csv:5: accel_z_mps2 = 9810: is out of range; allowed: -1000 to 1000"},
      {"imu.csv", "1700000000150000", "1699999999150000",
       "imu.csv:5: utime_us = 1699999999150000: time runs backwards, the row before has 1700000000100000 us"},
      {"imu.csv", "1700000000150000", "1700000000150000000",
       "imu.csv:5: utime_us = 1700000000150000000: is out of range"},
      {"imu.csv", "1700000000150000", "1.70000000015e15",
       "imu.csv:5: utime_us = 1.70000000015e15: is not a whole number"},
      {"imu.csv", "1700000000150000,0.001", "\n1700000000150000,0.001", "imu.csv:5: is empty"},
      {"imu.csv", "1700000000150000", "\x01garbage", "imu.csv:5: utime_us = "},
      {"gnss.csv", "48.100045000", "98.1", "gnss.csv:4: lat_deg = 98.1: is out of range; allowed: -90 to 90"},
      {"gnss.csv", ",rtk_float", ",RTK", "gnss.csv:4: fix_type = RTK: must be one of none, single, differential"},
      {"gnss.csv", ",vel_u_mps", "",
       "gnss.csv:1: column vel_u_mps is missing: vel_e_mps, vel_n_mps, vel_u_mps come together"},
      {"gnss.csv", ",heading_deg", "",
       "gnss.csv:1: column heading_deg is missing: heading_deg, std_heading_deg come together"},
      {"gnss.csv", "lat_deg", "latitude", "gnss.csv:1: column latitude is unknown"},
      {"gnss.csv", "0.01,0.02", "-0.01,0.02", "gnss.csv:2: std_e_m = -0.01: is out of range"},
      {"wheels.csv", ",rear_left_mps", "", "wheels.csv:1: column rear_left_mps is missing"},
      {"wheels.csv", "utime_us", "utime_us,speed_mps", "wheels.csv:1: must have either column speed_mps or the four"},
      {"wheels.csv", "10.2", "1020", "wheels.csv:2: front_right_mps = 1020: is out of range; allowed: -150 to 150"},
      {"mag.csv", "mag_x_ut", "mag_x_gauss", "mag.csv:1: column mag_x_gauss is unknown, did you mean mag_x_ut?"},
      {"mag.csv", "-42.5", "inf", "mag.csv:2: mag_z_ut = inf: is not a finite number"},
      {"frames_left.csv", "images/l1.png", "images/l7.png", "frames_left.csv:3: file = images/l7.png: no such file"},
      {"frames_right.csv", "1700000001100000", "1600000001100000",
       "frames_right.csv:3: utime_us = 1600000001100000: time runs"},
      {"reference.csv", "0.7071067812,0,0", "0.9,0,0", "reference.csv:2: qw = 0.9: the quaternion must have unit norm"},
      {"reference.csv", ",qz", "", "reference.csv:1: column qz is missing: qw, qx, qy, qz come together"},
  };
  for (const Break& one : breaks) {
    const test::TemporaryFolder folder;
    test::write_small_drive(folder.path());
    const fs::path path = folder.path() / one.file;
    test::write_file(path, replaced(test::read_file(path), one.from, one.to));
    INFO(one.file << ": " << one.from << " -> " << one.to);
    CHECK_THAT(error_of(folder.path()), Catch::Contains(one.error));
    CHECK_THAT(error_of(folder.path()), Catch::Contains(one.file));
  }
}

TEST_CASE("a missing, empty, cut or doubled file is an error that names it") {
  const test::TemporaryFolder folder;
  const fs::path& path = folder.path();
  CHECK_THAT(error_of(path / "nowhere"), Catch::EndsWith("nowhere: no such folder"));
  CHECK_THAT(error_of(path), Catch::EndsWith("drive.yaml: no such file"));
  test::write_file(path / "drive.yaml", "name: x\n");
  CHECK_THAT(error_of(path), Catch::Contains("holds no sensor"));
  test::write_file(path / "imu.csv", "");
  CHECK_THAT(error_of(path), Catch::Contains("imu.csv:1: needs a header line: utime_us"));
  test::write_small_drive(path);
  const std::string imu = test::read_file(path / "imu.csv");
  test::write_gzip(path / "imu.csv.gz", imu);
  CHECK_THAT(error_of(path), Catch::EndsWith("imu.csv: is there twice, plain and as .gz"));
  fs::remove(path / "imu.csv");
  CHECK(error_of(path) == "no error");
  const std::string packed = test::read_file(path / "imu.csv.gz");
  test::write_file(path / "imu.csv.gz", packed.substr(0, packed.size() / 2));
  CHECK_THAT(error_of(path), Catch::Contains("imu.csv.gz: is damaged or cut short"));
  fs::remove(path / "imu.csv.gz");
  test::write_file(path / "imu.csv", imu.substr(0, imu.find('\n') + 1));
  CHECK_THAT(error_of(path), Catch::Contains("imu.csv:1: has a header but no rows"));
  test::write_file(path / "imu.csv", imu);
  fs::remove(path / "reference.csv");
  CHECK_THAT(error_of(path), Catch::EndsWith("reference.csv: no such file, but drive.yaml has reference.of"));
  test::write_small_drive(path);
  fs::rename(path / "wheels.csv", path / "wheel.csv");
  CHECK_THAT(error_of(path), Catch::Contains("wheel.csv: is not part of a drive folder, did you mean wheels.csv?"));
}

TEST_CASE("garbage in place of a file is refused and never crashes") {
  for (const char* file :
       {"drive.yaml", "imu.csv", "gnss.csv", "wheels.csv", "mag.csv", "frames_left.csv", "reference.csv"}) {
    for (unsigned seed = 1; seed <= 20; ++seed) {
      const test::TemporaryFolder folder;
      test::write_small_drive(folder.path());
      std::string text = test::read_file(folder.path() / file);
      unsigned state = seed;
      for (int i = 0; i < 10; ++i) {
        state = state * 1664525U + 1013904223U;
        text[(state >> 8U) % text.size()] = static_cast<char>(state >> 24U);
      }
      test::write_file(folder.path() / file, text);
      CHECK_NOTHROW(error_of(folder.path()));
    }
  }
}

TEST_CASE("a drive folder whose files are cut anywhere is refused with the file, and leaves nothing") {
  const test::TemporaryFolder folder;
  test::write_small_drive(folder.path());
  const test::Cuts cuts = test::cut_every_file(folder.path(), folder.path());
  INFO(fmt::format("{} taken\n{}", cuts.taken, fmt::join(cuts.complaints, "\n")));
  CHECK(cuts.complaints.empty());
  CHECK(cuts.refused > 60);
}

}  // namespace
}  // namespace roadfix
