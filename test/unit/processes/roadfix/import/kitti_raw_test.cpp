// KITTI raw: frames and units of oxts, the calibration's chain, and every file broken.
#include "roadfix/import/kitti_raw.h"

#include <fmt/format.h>
#include <catch2/catch.hpp>

#include "config/config_error.h"
#include "cut_files.h"
#include "geometry/frames.h"
#include "roadfix/import/kitti_calib.h"
#include "roadfix/import/kitti_oxts.h"
#include "roadfix/import/source.h"
#include "small_drive.h"

namespace roadfix {
namespace {

namespace fs = std::filesystem;

constexpr const char* kTimes = "2011-09-26 13:02:25.964389445\n2011-09-26 13:02:26.064389445\n";

/// Standing, nose to the north-east, 30 deg; left side up by 0.1 rad.
std::string packet(double yaw, double roll) {
  return fmt::format(
      "49.015 8.434 116.4 {} 0.02 {} 3 4 5 0.1 -0.2 0.5 0.6 9.8 0.51 0.61 9.81 0.01 0.02 0.03 0.011 0.021 0.031 0.05 "
      "0.02 4 9 6 4 0\n",
      roll, yaw);
}

/// The day's files: the Velodyne 0.8 m behind and above the IMU, cameras looking ahead.
void write_calib(const fs::path& folder) {
  test::write_file(folder / "calib_imu_to_velo.txt",
                   "calib_time: 25-May-2012 16:47:16\nR: 1 0 0 0 1 0 0 0 1\nT: -0.8 0.3 -0.8\n");
  test::write_file(folder / "calib_velo_to_cam.txt",
                   "calib_time: 15-Mar-2012 11:37:16\nR: 0 -1 0 0 0 -1 1 0 0\nT: 0 -0.1 -0.3\n");
  test::write_file(folder / "calib_cam_to_cam.txt",
                   "calib_time: 09-Jan-2012 13:57:47\ncorner_dist: 9.95e-02\n"
                   "S_00: 10 8\nK_00: 720 0 5 0 721 4 0 0 1\nD_00: -0.37 0.2 0.001 0.002 -0.07\n"
                   "R_00: 1 0 0 0 1 0 0 0 1\nT_00: 0 0 0\n"
                   "S_rect_00: 8 6\nR_rect_00: 1 0 0 0 1 0 0 0 1\nP_rect_00: 700 0 4 0 0 700 3 0 0 0 1 0\n"
                   "S_01: 10 8\nK_01: 722 0 5 0 723 4 0 0 1\nD_01: -0.36 0.2 0 0 -0.07\n"
                   "R_01: 1 0 0 0 1 0 0 0 1\nT_01: -0.54 0 0\n"
                   "S_rect_01: 8 6\nR_rect_01: 1 0 0 0 1 0 0 0 1\nP_rect_01: 700 0 4 -378 0 700 3 0 0 0 1 0\n");
}

void write_raw(const fs::path& drive, int width = 8, int height = 6) {
  fs::create_directories(drive / "oxts/data");
  test::write_file(drive / "oxts/timestamps.txt", kTimes);
  test::write_file(drive / "oxts/data/0000000000.txt", packet(kPi / 6.0, 0.1));
  test::write_file(drive / "oxts/data/0000000001.txt", packet(kPi / 6.0, 0.1));
  for (const char* camera : {"image_00", "image_01"}) {
    fs::create_directories(drive / camera / "data");
    test::write_file(drive / camera / "timestamps.txt", kTimes);
    for (const char* name : {"0000000000.png", "0000000001.png"}) {
      test::write_file(drive / camera / "data" / name, test::tiny_png(width, height));
    }
  }
  write_calib(drive.parent_path());
}

Drive read(const fs::path& drive, bool gnss = false) {
  SourceOptions options;
  options.format = detect_format(drive);
  options.gnss_from_oxts = gnss;
  return read_source(drive, options);
}

std::string said(const Drive& drive) { return fmt::format("{}", fmt::join(drive.remarks, "\n")); }

TEST_CASE("KITTI raw: oxts is the reference and the IMU, in our axes and units") {
  const test::TemporaryFolder folder;
  const fs::path path = folder / "2011_09_26_drive_0001_sync";
  write_raw(path);
  const Drive drive = read(path);
  CHECK(drive.format == "kitti_raw");
  CHECK(drive.description.name == "2011_09_26_drive_0001_sync");
  REQUIRE(drive.imu.size() == 2);
  CHECK(drive.imu[0].t_us == 1317042145964389);
  CHECK(drive.imu[0].gyro == Eigen::Vector3d(0.01, 0.02, 0.03));
  CHECK(drive.imu[0].accel == Eigen::Vector3d(0.5, 0.6, 9.8));
  const ReferencePoint& point = drive.reference.at(0);
  CHECK(point.position.latitude == Approx(49.015 * kDegree));
  CHECK(point.position.height == 116.4);
  CHECK(*point.velocity_enu == Eigen::Vector3d(4.0, 3.0, -0.2));
  // Yaw 30 deg from east to north; the left side is up, the nose a little down.
  const Eigen::Vector3d ahead = *point.q_enu_body * Eigen::Vector3d::UnitX();
  CHECK(std::atan2(ahead.y(), ahead.x()) == Approx(kPi / 6.0));
  CHECK(ahead.z() == Approx(-std::sin(0.02)));
  CHECK((*point.q_enu_body * Eigen::Vector3d::UnitY()).z() > 0.09);
  CHECK(drive.description.reference.of == ReferenceOf::kImu);
  CHECK(drive.description.reference.sigma == Approx(0.05));
  CHECK(drive.gnss.empty());
  CHECK_THAT(said(drive), Catch::Contains("left out: gnss. oxts holds no fixes of GNSS alone"));
  CHECK_THAT(said(drive), Catch::Contains("imu comes at 10 Hz and tells moments"));
}

TEST_CASE("KITTI raw: fixes only where they are asked for") {
  const test::TemporaryFolder folder;
  write_raw(folder / "drive");
  const Drive drive = read(folder / "drive", true);
  REQUIRE(drive.gnss.size() == 2);
  CHECK(drive.gnss[0].fix_type == FixType::kRtkFixed);
  CHECK(drive.gnss[0].cov_enu(0, 0) == Approx(0.0025));
  CHECK(drive.gnss[0].velocity->enu == Eigen::Vector3d(4.0, 3.0, -0.2));
  CHECK(drive.gnss[0].num_satellites == 9);
  CHECK_THAT(said(drive), Catch::Contains("the same as the reference"));
}

TEST_CASE("KITTI raw: cameras sit where the chain of calibrations puts them") {
  const test::TemporaryFolder folder;
  write_raw(folder / "rectified");
  const auto rectified = read(folder / "rectified").description.calibration.sensors;
  CHECK(rectified.camera_left->intrinsics_px == Eigen::Vector4d(700, 700, 4, 3));
  CHECK(rectified.camera_left->distortion->model == DistortionModel::kNone);
  // A point 10 m ahead of the IMU: in the Velodyne 9.2 m ahead, in the camera 8.9 m deep.
  const SE3 T_camera_imu = rectified.camera_left->mounting->T_body_camera().inverse();
  CHECK((T_camera_imu * Eigen::Vector3d(10.0, 0.0, 0.0) - Eigen::Vector3d(-0.3, 0.7, 8.9)).norm() < 1e-9);
  // P_rect's fourth column: the right eye is 0.54 m to the right, which is -y of the IMU.
  const Eigen::Vector3d baseline = rectified.camera_right->mounting->p - rectified.camera_left->mounting->p;
  CHECK((baseline - Eigen::Vector3d(0.0, -0.54, 0.0)).norm() < 1e-9);

  write_raw(folder / "raw", 10, 8);
  const Drive raw = read(folder / "raw");
  const auto& lens = raw.description.calibration.sensors;
  CHECK(lens.camera_left->intrinsics_px == Eigen::Vector4d(720, 721, 5, 4));
  CHECK(lens.camera_left->distortion->coefficients == std::vector<double>{-0.37, 0.2, 0.001, 0.002, -0.07});
  CHECK((lens.camera_right->mounting->p - lens.camera_left->mounting->p - baseline).norm() < 1e-9);
  CHECK_THAT(said(raw), Catch::Contains("image_00: 10 x 8, not rectified"));
}

TEST_CASE("KITTI raw: a packet whose time runs backwards is left out, and told") {
  const test::TemporaryFolder folder;
  write_raw(folder / "drive");
  test::write_file(folder / "drive/oxts/timestamps.txt",
                   "2011-09-26 13:02:25.964389445\n2011-09-26 13:02:25.864389445\n");
  const Drive drive = read(folder / "drive");
  CHECK(drive.imu.size() == 1);
  CHECK_THAT(said(drive), Catch::Contains("left out: 1 packets of oxts"));
}

std::string error_of(const fs::path& drive) {
  try {
    read(drive);
  } catch (const ConfigError& e) {
    return e.what();
  }
  return "no error";
}

struct Break {
  const char* file;
  std::string text;  // "-": remove the file
  const char* error;
};

TEST_CASE("KITTI raw: what is broken is told with file, line and what must be there") {
  const std::vector<Break> breaks = {
      {"d/oxts/timestamps.txt", "", "timestamps.txt: holds no times"},
      {"d/oxts/timestamps.txt", "1317042145.9\n", "timestamps.txt:1: '1317042145.9': must be a time like"},
      {"d/oxts/timestamps.txt", "2011-02-30 13:02:25.964389445\n", "timestamps.txt:1: '2011-02-30"},
      {"d/oxts/timestamps.txt", "2011-09-26 13:02:25.964389445\n2011-09-26 13:02:26.06\n", "timestamps.txt:2:"},
      {"d/oxts/timestamps.txt", "2011-09-26 13:02:25.964389445\n", "0000000001.txt: has no time in timestamps.txt"},
      {"d/oxts/timestamps.txt", "-", "timestamps.txt: no such file"},
      {"d/oxts/data/0000000001.txt", "-", "0000000001.txt: no such file"},
      {"d/oxts/data/0000000001.txt", "1 2 3\n", "0000000001.txt:1: has 3 numbers, a packet has 30"},
      {"d/oxts/data/0000000001.txt", packet(0.0, 0.0) + packet(0.0, 0.0), "0000000001.txt:2: a packet is one line"},
      {"d/oxts/data/0000000001.txt", packet(30.0, 0.0), "0000000001.txt:1: yaw (number 6) = 30: must be within"},
      {"d/image_00/data/0000000000.png", "-", "0000000000.png: no such file, but timestamps.txt has its time"},
      {"d/image_00/data/0000000000.png", "x", "0000000000.png: is no picture"},
      {"d/image_01/data/0000000002.png", "x", "0000000002.png: has no time in timestamps.txt"},
      {"d/image_00/timestamps.txt", "2011-09-26 13:02:26.000000000\n2011-09-26 13:02:25.000000000\n",
       "timestamps.txt:2: time runs backwards"},
      {"calib_imu_to_velo.txt", "-", "calib_imu_to_velo.txt: no such file"},
      {"calib_imu_to_velo.txt", "R: 2 0 0 0 1 0 0 0 1\nT: 0 0 0\n", "calib_imu_to_velo.txt:1: R is not a rotation"},
      {"calib_velo_to_cam.txt", "R: 1 0 0 0 1 0 0 0\n", "calib_velo_to_cam.txt:1: R has 8 numbers, must have 9"},
      {"calib_velo_to_cam.txt", "R: 1 0 0 0 1 0 0 0 1\nT: 0 -90 0\n",
       "calib_velo_to_cam.txt:2: T: must be within 50 m"},
      {"calib_cam_to_cam.txt", "S_rect_00: 8 6\nP_rect_00: 7x 0\n", "calib_cam_to_cam.txt:2: P_rect_00[0] = 7x"},
      {"calib_cam_to_cam.txt", "S_rect_00: 8 5\nS_00: 9 9\n",
       "pictures of image_00 are 8 x 6, which is neither S_rect_00"},
      {"calib_cam_to_cam.txt", "S_00: 8 6\n", "calib_cam_to_cam.txt: has no line S_rect_00:"},
  };
  for (const Break& one : breaks) {
    const test::TemporaryFolder folder;
    write_raw(folder / "d");
    if (one.text == "-") {
      fs::remove(folder.path() / one.file);
    } else {
      test::write_file(folder.path() / one.file, one.text);
    }
    INFO(one.file << " <- " << one.text);
    CHECK_THAT(error_of(folder / "d"), Catch::Contains(one.error));
  }
}

TEST_CASE("KITTI raw: a text that is cut anywhere before its last number is an error") {
  const std::string whole = packet(0.5, 0.1);
  for (std::size_t n = 0; n + 3 < whole.size(); ++n) CHECK_THROWS_AS(parse_oxts(whole.substr(0, n), "p"), ConfigError);
  CHECK_NOTHROW(parse_oxts(whole, "p"));
  const std::string times = kTimes;
  for (std::size_t n = 0; n < times.size(); ++n) {
    // What is cut behind a whole line lacks a time for the second packet, which the reader finds.
    if (n == times.size() / 2 || n == times.size() / 2 - 1 || n == times.size() - 1) continue;
    CHECK_THROWS_AS(parse_kitti_times(times.substr(0, n), "t"), ConfigError);
  }
}

TEST_CASE("a folder with pictures of KITTI raw but without oxts is named as that") {
  const test::TemporaryFolder folder;
  fs::create_directories(folder / "image_00");
  CHECK_THROWS_WITH(detect_format(folder.path()),
                    Catch::Contains("looks like KITTI raw, as image_00 is there, but oxts is missing"));
}

TEST_CASE("KITTI raw: files that are cut anywhere are refused, and leave nothing") {
  const test::TemporaryFolder folder;
  write_raw(folder / "drive");
  const test::Cuts cuts = test::cut_every_file(folder.path(), folder / "drive");
  INFO(fmt::format("{} taken\n{}", cuts.taken, fmt::join(cuts.complaints, "\n")));
  CHECK(cuts.complaints.empty());
  CHECK(cuts.refused > 100);
}

}  // namespace
}  // namespace roadfix
