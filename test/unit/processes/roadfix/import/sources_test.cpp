// KITTI, EuRoC and pose files, small and broken ones.
#include "roadfix/import/source.h"

#include <fmt/format.h>
#include <catch2/catch.hpp>
#include <opencv2/imgcodecs.hpp>

#include "config/config_error.h"
#include "cut_files.h"
#include "geometry/so3.h"
#include "roadfix/import/image_header.h"
#include "roadfix/import/pose_files.h"
#include "small_drive.h"

namespace roadfix {
namespace {

namespace fs = std::filesystem;

constexpr const char* kTwoPoses = "1 0 0 0 0 1 0 0 0 0 1 0\n0 0 1 -0.5 0 1 0 -0.25 -1 0 0 2\n";

void write_small_kitti(const fs::path& folder) {
  fs::create_directories(folder / "image_0");
  fs::create_directories(folder / "image_1");
  for (const char* name : {"image_0/000000.png", "image_0/000001.png", "image_1/000000.png"}) {
    test::write_file(folder / name, test::tiny_png(8, 6));
  }
  test::write_file(folder / "times.txt", "0.000000e+00\n1.037359e-01\n");
  test::write_file(folder / "poses.txt", kTwoPoses);
  test::write_file(folder / "calib.txt", "P0: 700 0 4 0 0 700 3 0 0 0 1 0\nP1: 700 0 4 -350 0 700 3 0 0 0 1 0\n");
}

constexpr const char* kImuHeader =
    "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],"
    "a_RS_S_z [m s^-2]\n";

void write_small_euroc(const fs::path& folder) {
  const fs::path mav = folder / "mav0";
  for (const char* name : {"imu0", "cam0/data", "state_groundtruth_estimate0"}) fs::create_directories(mav / name);
  test::write_file(mav / "imu0/data.csv",
                   fmt::format("{}{}", kImuHeader,
                               "1403715273262142976,0.1,0.2,0.3,9.8,0,0\n1403715273267142912,0.1,0.2,0.3,9.8,0,0\n"));
  test::write_file(
      mav / "imu0/sensor.yaml",
      "%YAML:1.0\nsensor_type: imu\nT_BS:\n  cols: 4\n  rows: 4\n  data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, "
      "1]\nrate_hz: 200\ngyroscope_noise_density: 1.7e-4\ngyroscope_random_walk: 1.9e-5\n");
  test::write_file(mav / "cam0/data.csv", "#timestamp [ns],filename\n1403715273262142976,a.png\n");
  test::write_file(mav / "cam0/data/a.png", test::tiny_png(8, 6));
  test::write_file(mav / "cam0/sensor.yaml",
                   "%YAML:1.0\nsensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: [0, -1, 0, 0.1, 1, 0, 0, 0.2, "
                   "0, 0, 1, 0.3, "
                   "0, 0, 0, 1]\nrate_hz: 20\nresolution: [8, 6]\ncamera_model: pinhole\nintrinsics: [9, 9, 4, 3]\n"
                   "distortion_model: radial-tangential\ndistortion_coefficients: [-0.2, 0.1, 0, 0]\n");
  test::write_file(mav / "state_groundtruth_estimate0/data.csv",
                   "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []\n"
                   "1403715273262142976,1,2,3,0.5,-0.5,0.5,-0.5\n");
}

/// The same as TUM VI has it: no sensor.yaml, one chain of Kalibr, motion capture for ground truth.
void write_small_tum_vi(const fs::path& folder) {
  write_small_euroc(folder);
  const fs::path mav = folder / "mav0";
  fs::remove(mav / "imu0/sensor.yaml");
  fs::remove(mav / "cam0/sensor.yaml");
  fs::rename(mav / "state_groundtruth_estimate0", mav / "mocap0");
  test::write_file(
      mav / "mocap0/data.csv",
      "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []\n"
      "1403715273262142976,1,2,3,0.5,-0.5,0.5,-0.5\n1403715373262142976,1,2,3,0.5,-0.5,0.5,-0.5\n");
  fs::copy(mav / "cam0", mav / "cam1", fs::copy_options::recursive);
  fs::create_directories(folder / "dso");
  const std::string lens =
      "  camera_model: pinhole\n  distortion_model: equidistant\n  distortion_coeffs: [0.003, 0.0007, -0.002, 0.0002]\n"
      "  intrinsics: [190.9, 190.9, 254.9, 256.8]\n  resolution: [8, 6]\n  rostopic: /cam0/image_raw\n";
  test::write_file(folder / "dso/camchain.yaml",
                   "cam0:\n  T_cam_imu: [[1, 0, 0, 0.1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n" + lens +
                       "cam1:\n  T_cam_imu: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n" + lens);
  test::write_file(folder / "dso/imu_config.yaml",
                   "rostopic: /imu0\nupdate_rate: 200.0\naccelerometer_noise_density: 0.0028\n"
                   "accelerometer_random_walk: 0.00086\ngyroscope_noise_density: 0.00016\n"
                   "gyroscope_random_walk: 0.000022\n");
}

void write_small_poses(const fs::path& folder) {
  test::write_file(folder / "a_times.txt", "0\n0.5\n1.0\n");
  test::write_file(folder / "a_reference.txt", kTwoPoses);
  test::write_file(folder / "a_keyframes.txt", "0 1 0 0 0 0 1 0 0 0 0 1 0\n2 1 0 0 5 0 1 0 6 0 0 1 7\n");
}

Drive read(const fs::path& folder) { return read_source(folder, {detect_format(folder), "", {}, {}}); }

std::string error_of(const fs::path& folder) {
  try {
    read(folder);
  } catch (const ConfigError& e) {
    return e.what();
  }
  return "no error";
}

TEST_CASE("a KITTI sequence is read with its cameras and poses") {
  const test::TemporaryFolder folder;
  write_small_kitti(folder.path());
  const Drive drive = read(folder.path());
  CHECK(drive.format == "kitti");
  CHECK(drive.frames_left.size() == 2);
  CHECK(drive.frames_left[1].t_us == 103736);
  CHECK(drive.frames_right.size() == 1);
  const auto& sensors = drive.description.calibration.sensors;
  CHECK(sensors.camera_left->intrinsics_px == Eigen::Vector4d(700, 700, 4, 3));
  CHECK(sensors.camera_right->mounting->p.y() == Approx(-0.5));
  REQUIRE(drive.local_reference.size() == 2);
  // 2 m ahead of the camera is x, 0.5 m to its left is y, 0.25 m up is z; a turn to the left about y down is about z
  // up.
  const SE3& pose = drive.local_reference[1].T_local_body;
  CHECK((pose.p - Eigen::Vector3d(2.0, 0.5, 0.25)).norm() < 1e-12);
  CHECK((log_q(pose.q) - Eigen::Vector3d(0.0, 0.0, -std::acos(-1.0) / 2.0)).norm() < 1e-12);
}

TEST_CASE("a EuRoC recording is read with its own axes") {
  const test::TemporaryFolder folder;
  write_small_euroc(folder.path());
  const Drive drive = read(folder.path());
  CHECK(drive.format == "euroc");
  CHECK(drive.imu.at(0).t_us == 1403715273262142);
  CHECK(drive.imu[1].accel.x() == 9.8);
  CHECK(drive.frames_left.size() == 1);
  const auto& sensors = drive.description.calibration.sensors;
  CHECK(sensors.imu->gyro_noise == 1.7e-4);
  CHECK_FALSE(sensors.imu->gyro_bias_std.has_value());
  CHECK(sensors.camera_left->mounting->p.z() == 0.3);
  CHECK(sensors.camera_left->distortion->coefficients.size() == 4);
  CHECK(drive.local_reference.at(0).T_local_body.p == Eigen::Vector3d(1, 2, 3));
  CHECK(drive.description.reference.of == ReferenceOf::kImu);
  CHECK(read(folder.path() / "mav0").imu.size() == 2);
}

TEST_CASE("a TUM VI recording is read with its fisheye lenses and motion capture") {
  const test::TemporaryFolder folder;
  write_small_tum_vi(folder.path());
  const Drive drive = read(folder.path());
  CHECK(drive.description.origin == "TUM VI recording");
  CHECK(drive.imu.size() == 2);
  CHECK(drive.frames_right.size() == 1);
  const auto& sensors = drive.description.calibration.sensors;
  CHECK(sensors.imu->rate == 200.0);
  CHECK(sensors.imu->accel_noise == 0.0028);
  CHECK(sensors.camera_left->model == CameraModel::kFisheye);
  CHECK(sensors.camera_left->distortion->model == DistortionModel::kEquidistant);
  CHECK(sensors.camera_left->distortion->coefficients[1] == 0.0007);
  CHECK(sensors.camera_left->mounting->p.x() == -0.1);
  CHECK(sensors.camera_right->mounting->p.x() == 0.0);
  CHECK(drive.local_reference.size() == 2);
  CHECK_THAT(fmt::format("{}", fmt::join(drive.remarks, "\n")), Catch::Contains("mocap0) has a gap of 100 s"));
  // The chain names the right eye first: the pictures keep their folders, and each its own lens.
  std::string chain = test::read_file(folder / "dso/camchain.yaml");
  chain.replace(chain.find("0.1]"), 4, "-.1]");
  test::write_file(folder / "dso/camchain.yaml", chain);
  CHECK(read(folder.path()).description.calibration.sensors.camera_left->mounting->p.x() == 0.1);
}

TEST_CASE("poses of every kind of file are read") {
  const test::TemporaryFolder folder;
  write_small_poses(folder.path());
  const Drive drive = read(folder.path());
  CHECK(drive.format == "poses");
  CHECK(drive.description.name == "a");
  REQUIRE(drive.estimate.size() == 2);
  CHECK(drive.estimate[1].t_us == 1000000);
  CHECK((drive.estimate[1].T_local_body.p - Eigen::Vector3d(7.0, -5.0, -6.0)).norm() < 1e-12);
  CHECK(drive.local_reference.size() == 2);
  const fs::path tum = folder.path() / "tum.txt";
  test::write_file(tum, "# t x y z qx qy qz qw\n1700000000.25 1 2 3 0 0 0 1\n");
  const Drive single = read_source(tum, {detect_format(tum), "", {}, {}});
  CHECK(single.estimate.at(0).t_us == 1700000000250000);
}

struct Break {
  void (*write)(const fs::path&);
  const char* file;
  const char* text;  // nullptr: remove the file
  const char* error;
};

TEST_CASE("a broken file of each format gives the error a user needs") {
  const std::vector<Break> breaks = {
      {write_small_kitti, "times.txt", "0.1\nx\n", "times.txt:2: field 1 = x: is not a finite number"},
      {write_small_kitti, "times.txt", "0.1\n0.05\n", "times.txt:2: time = 0.05 s: time runs backwards"},
      {write_small_kitti, "times.txt", "0.1 0.2\n", "times.txt:1: has 2 numbers, must have 1"},
      {write_small_kitti, "times.txt", "-1\n", "times.txt:1: time = -1 s: is out of range"},
      {write_small_kitti, "times.txt", "0.1\n", "000001.png: has no time in times.txt"},
      {write_small_kitti, "times.txt", nullptr, "times.txt: no such file"},
      {write_small_kitti, "times.txt", "", "times.txt: holds no numbers"},
      {write_small_kitti, "poses.txt", "1 0 0 0 0 1 0 0 0 0 1\n", "poses.txt:1: has 11 numbers; a pose has 12 (KITTI)"},
      {write_small_kitti, "poses.txt", "1 0 0 0 0 1 0 0 0 0 1 nan\n",
       "poses.txt:1: field 12 = nan: is not a finite number"},
      {write_small_kitti, "poses.txt", "2 0 0 0 0 1 0 0 0 0 1 0\n", "poses.txt:1: the 3x3 part is not a rotation"},
      {write_small_kitti, "poses.txt", "1 0 0 1e9 0 1 0 0 0 0 1 0\n", "poses.txt:1: the position is farther away"},
      {write_small_kitti, "calib.txt", "P1: 1 2 3\n", "calib.txt: has no line P0:"},
      {write_small_kitti, "calib.txt", "P0: 700 0 4\n", "calib.txt:1: P0 must have 12 numbers"},
      {write_small_kitti, "calib.txt", "P0: 700 0 4 0 0 7x0 3 0 0 0 1 0\n",
       "calib.txt:1: P0[5] = 7x0: is not a finite number"},
      {write_small_kitti, "image_0/000000.png", nullptr, "000000.png: no such file"},
      {write_small_kitti, "image_0/000000.png", "x", "000000.png: is no picture"},
      {write_small_euroc, "mav0/imu0/data.csv", "#timestamp [ns],w\n1,2\n", "data.csv:1: column w is unknown"},
      {write_small_euroc, "mav0/imu0/data.csv", kImuHeader, "data.csv:1: has a header but no rows"},
      {write_small_euroc, "mav0/imu0/data.csv", nullptr, "data.csv: no such file"},
      {write_small_euroc, "mav0/imu0/sensor.yaml", "rate_khz: 1\n",
       "sensor.yaml:1: rate_khz is unknown, did you mean rate_hz?"},
      {write_small_euroc, "mav0/cam0/sensor.yaml", "camera_model: omni\n", "camera_model = omni: must be pinhole"},
      {write_small_euroc, "mav0/cam0/sensor.yaml", "T_BS: {rows: 4, cols: 4, data: [1]}\n",
       "T_BS.data = a list: has 1 entries"},
      {write_small_euroc, "mav0/cam0/data/a.png", nullptr, "data.csv:2: filename = a.png: no such file in data/"},
      {write_small_tum_vi, "dso/camchain.yaml", nullptr, "cam0/sensor.yaml: no such file, and no"},
      {write_small_tum_vi, "dso/camchain.yaml", "cam0: {camera_model: omni}\n", "camchain.yaml"},
      {write_small_tum_vi, "dso/imu_config.yaml", nullptr, "imu0/sensor.yaml: no such file"},
      {write_small_tum_vi, "dso/imu_config.yaml", "update_rates: 1\n",
       "update_rates is unknown, did you mean update_rate?"},
      {write_small_tum_vi, "mav0/mocap0/data.csv", "#timestamp [ns],p\n1,2\n", "data.csv:1: column p is unknown"},
      {write_small_poses, "a_keyframes.txt", "7 1 0 0 0 0 1 0 0 0 0 1 0\n",
       "a_keyframes.txt:1: frame 7 has no time; there are 3"},
      {write_small_poses, "a_keyframes.txt", "2 1 0 0 0 0 1 0 0 0 0 1 0\n1 1 0 0 0 0 1 0 0 0 0 1 0\n",
       "a_keyframes.txt:2: time runs backwards"},
      {write_small_poses, "a_keyframes.txt", "0 1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 1 0\n",
       "a_keyframes.txt:2: has 12 numbers, the first row has 13"},
      {write_small_poses, "b_times.txt", "0\n", "holds several sequences; choose one by --sequence: a, b"},
      {write_small_poses, "a_other.txt", "0\n", "must have one a_*.txt beside times and reference, has 2"},
  };
  for (const Break& one : breaks) {
    const test::TemporaryFolder folder;
    one.write(folder.path());
    if (one.text != nullptr) {
      test::write_file(folder.path() / one.file, one.text);
    } else {
      fs::remove(folder.path() / one.file);
    }
    INFO(one.file << " <- " << (one.text == nullptr ? "removed" : one.text));
    CHECK_THAT(error_of(folder.path()), Catch::Contains(one.error));
  }
}

TEST_CASE("a folder of no known format says what each format misses in it") {
  const test::TemporaryFolder folder;
  CHECK_THAT(error_of(folder.path()),
             Catch::Contains("is no format known here: for a drive folder drive.yaml is missing"));
  CHECK_THAT(error_of(folder.path()), Catch::Contains("for KITTI odometry calib.txt, image_0 or image_2 is missing"));
  test::write_file(folder / "calib.txt", "");
  CHECK_THAT(error_of(folder.path()),
             Catch::Contains("looks like KITTI odometry, as calib.txt is there, but image_0 or image_2 is missing"));
  test::write_file(folder / "imu.csv", "");
  CHECK_THAT(error_of(folder.path()),
             Catch::EndsWith("looks like a drive folder, as imu.csv is there, but drive.yaml is missing"));
  CHECK_THAT(error_of(folder.path() / "none"), Catch::Contains("none: no such file or folder"));
}

std::optional<ImageHeader> header_of(const std::string& bytes) {
  return read_image_header(std::span(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()));
}

TEST_CASE("picture sizes are read from the first bytes and never beyond the last") {
  const std::string png = test::tiny_png(1241, 376);
  CHECK(header_of(png)->width_px == 1241);
  CHECK(header_of(png)->height_px == 376);
  const std::string jpeg("\xff\xd8\xff\xe0\x00\x04\x01\x02\xff\xff\xc0\x00\x0b\x08\x02\x58\x03\x20\x01\x11\x00", 21);
  REQUIRE(header_of(jpeg).has_value());
  CHECK(header_of(jpeg)->kind == ImageHeader::Kind::kJpeg);
  CHECK(header_of(jpeg)->width_px == 800);
  CHECK(header_of(jpeg)->height_px == 600);
  for (std::size_t n = 0; n < 20; ++n) CHECK_FALSE(header_of(png.substr(0, n)).has_value());
  for (std::size_t n = 0; n < 18; ++n) CHECK_FALSE(header_of(jpeg.substr(0, n)).has_value());
  CHECK_FALSE(header_of("GIF89a and so on, long enough to hold a size").has_value());
}

TEST_CASE("a picture whose end is missing is known as that, wherever it ends") {
  const auto has_end = [](const std::string& bytes, ImageHeader::Kind kind) {
    return has_image_end(std::span(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()), kind);
  };
  std::vector<uint8_t> pixels(96 * 64);
  for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] = static_cast<uint8_t>(i * i / 7);
  const cv::Mat picture(64, 96, CV_8UC1, pixels.data());
  for (const auto& [extension, kind] :
       {std::pair(".png", ImageHeader::Kind::kPng), std::pair(".jpg", ImageHeader::Kind::kJpeg)}) {
    CAPTURE(extension);
    std::vector<uint8_t> packed;
    REQUIRE(cv::imencode(extension, picture, packed, {cv::IMWRITE_JPEG_RST_INTERVAL, 4}));
    const std::string file(packed.begin(), packed.end());
    CHECK(has_end(file, kind));
    CHECK(has_end(file + std::string(5, '\0'), kind));  // what a writer has put behind it harms nobody
    for (std::size_t n = 0; n < file.size(); ++n) {
      if (has_end(file.substr(0, n), kind)) FAIL(n << " of " << file.size() << " bytes have an end");
    }
    if (kind == ImageHeader::Kind::kPng) continue;
    // A thumbnail in the first segment has an end of its own.
    const std::string thumbnail = std::string("\xff\xe1\x00\x08", 4) + "ab\xff\xd9" + "cd";
    const std::string with = file.substr(0, 2) + thumbnail + file.substr(2);
    CHECK(has_end(with, kind));
    CHECK_FALSE(has_end(with.substr(0, with.size() / 2), kind));
  }
}

TEST_CASE("recordings whose files are cut anywhere are refused with the file, and leave nothing") {
  for (const auto write : {write_small_kitti, write_small_euroc, write_small_tum_vi, write_small_poses}) {
    const test::TemporaryFolder folder;
    write(folder.path());
    const test::Cuts cuts = test::cut_every_file(folder.path(), folder.path());
    INFO(fmt::format("{} taken\n{}", cuts.taken, fmt::join(cuts.complaints, "\n")));
    CHECK(cuts.complaints.empty());
    CHECK(cuts.refused > 20);
  }
}

}  // namespace
}  // namespace roadfix
