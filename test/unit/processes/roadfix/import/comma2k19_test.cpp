// comma2k19 segments: arrays of numpy, axes, times, the film; and every file broken.
#include "roadfix/import/comma2k19.h"

#include <fmt/format.h>
#include <catch2/catch.hpp>

#include <cstring>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include "config/config_error.h"
#include "cut_files.h"
#include "geometry/euler.h"
#include "geometry/frames.h"
#include "roadfix/import/image_header.h"
#include "roadfix/import/npy.h"
#include "roadfix/import/source.h"
#include "small_drive.h"

namespace roadfix {
namespace {

namespace fs = std::filesystem;

constexpr double kBoot = 250.0;  // s, of the first frame
constexpr int kFrames = 40;
constexpr int64_t kFirst_us = 1533224087'500000;  // 2018-08-02 15:34:47.5 UTC

using Rows = std::vector<std::vector<double>>;

template <class T>
std::string npy(const std::string& type, const std::string& shape, const std::vector<T>& numbers,
                const char* order = "False") {
  std::string header = fmt::format("{{'descr': '{}', 'fortran_order': {}, 'shape': {}, }}", type, order, shape);
  header.append(63 - (10 + header.size()) % 64, ' ');
  header += '\n';
  std::string out("\x93NUMPY\x01\x00", 8);
  out += static_cast<char>(header.size() & 0xFFU);
  out += static_cast<char>(header.size() >> 8U);
  out += header;
  out.append(reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(T));
  return out;
}

std::string npy(const Rows& rows) {
  std::vector<double> all;
  for (const auto& row : rows) all.insert(all.end(), row.begin(), row.end());
  const std::size_t columns = rows.empty() ? 1 : rows.front().size();
  return npy("<f8", columns == 1 ? fmt::format("({},)", rows.size()) : fmt::format("({}, {})", rows.size(), columns),
             all);
}

Rows times(int count, double dt) {
  Rows rows;
  for (int i = 0; i < count; ++i) rows.push_back({kBoot + dt * i});
  return rows;
}

void write_log(const fs::path& folder, const Rows& t, const std::vector<double>& row) {
  fs::create_directories(folder);
  test::write_file(folder / "t", npy(t));
  test::write_file(folder / "value", npy(Rows(t.size(), row)));
}

const Geodetic kPlace{37.5 * kDegree, -122.2 * kDegree, 30.0};

/// A car that goes north-east at 20 m/s, told in ECEF with axes forward, right, down.
void write_poses(const fs::path& pose) {
  fs::create_directories(pose);
  const EnuAnchor anchor(kPlace);
  const Eigen::Quaterniond q_enu_flu = quaternion({kPi / 4.0, 0.0, 0.0});
  const Eigen::Quaterniond q_ecef_frd =
      Eigen::Quaterniond(anchor.R_ecef_enu()) * q_enu_flu * Eigen::Quaterniond(0.0, 1.0, 0.0, 0.0);
  Rows t, gps, p, q, v;
  for (int i = 0; i < kFrames; ++i) {
    const double dt = 0.05 * i;
    const Eigen::Vector3d way = std::sqrt(200.0) * Eigen::Vector3d(1.0, 1.0, 0.0);
    const Eigen::Vector3d position = ecef_from_geodetic(anchor.geodetic(way * dt));
    const Eigen::Vector3d velocity = anchor.R_ecef_enu() * way;
    t.push_back({kBoot + dt});
    // kFirst_us is 1216 days and some after week 1838's begin; as GPS has it, 18 s more.
    const double gps_s = static_cast<double>(kFirst_us / 1000) * 1e-3 + dt - 315964800.0 + 18.0;
    const double week = std::floor(gps_s / 604800.0);
    gps.push_back({week, gps_s - 604800.0 * week});
    p.push_back({position.x(), position.y(), position.z()});
    v.push_back({velocity.x(), velocity.y(), velocity.z()});
    q.push_back({q_ecef_frd.w(), q_ecef_frd.x(), q_ecef_frd.y(), q_ecef_frd.z()});
  }
  test::write_file(pose / "frame_times", npy(t));
  test::write_file(pose / "frame_gps_times", npy(gps));
  test::write_file(pose / "frame_positions", npy(p));
  test::write_file(pose / "frame_velocities", npy(v));
  test::write_file(pose / "frame_orientations", npy(q));
}

void write_segment(const fs::path& segment) {
  const fs::path log = segment / "processed_log";
  write_log(log / "IMU" / "gyro", times(200, 0.01), {0.01, 0.02, 0.03});
  Rows accel_times = times(200, 0.01);
  for (auto& row : accel_times) row[0] -= 0.004;
  write_log(log / "IMU" / "accelerometer", accel_times, {0.1, 0.2, -9.8});
  write_log(log / "GNSS" / "live_gnss_ublox", times(20, 0.1), {37.5, -122.2, 20.0, 1533224087.5, 30.0, 45.0});
  write_log(log / "GNSS" / "live_gnss_qcom", times(2, 1.0), {37.5, -122.2, 20.0, 0.0, 30.0, 45.0});
  write_log(log / "CAN" / "wheel_speed", times(100, 0.02), {20.1, 20.2, 20.0, 20.05});
  write_poses(segment / "global_pose");
}

bool write_film(const fs::path& path, int pictures) {
  cv::VideoWriter writer(path.string(), cv::CAP_FFMPEG, cv::VideoWriter::fourcc('H', 'E', 'V', 'C'), 20.0, {192, 144});
  if (!writer.isOpened()) return false;
  for (int i = 0; i < pictures; ++i) writer.write(cv::Mat(144, 192, CV_8UC3, cv::Scalar(5 * i, 100, 200)));
  return true;
}

Drive read(const fs::path& segment) {
  SourceOptions options;
  options.format = detect_format(segment);
  return read_source(segment, options);
}

std::string said(const Drive& drive) { return fmt::format("{}", fmt::join(drive.remarks, "\n")); }

TEST_CASE("comma2k19: axes, times and the poses of a segment become ours") {
  const test::TemporaryFolder folder;
  const fs::path segment = folder / "b0c9|2018-08-02--08-34-47" / "40";
  write_segment(segment);
  const Drive drive = read(segment);
  CHECK(drive.format == "comma2k19");
  CHECK(drive.description.name == "b0c9|2018-08-02--08-34-47 40");
  REQUIRE(drive.imu.size() == 199);  // accelerations end 4 ms before the gyro
  CHECK(drive.imu[0].t_us == kFirst_us);
  CHECK(drive.imu[3].gyro == Eigen::Vector3d(0.01, -0.02, -0.03));
  CHECK((drive.imu[3].accel - Eigen::Vector3d(0.1, -0.2, 9.8)).norm() < 1e-12);
  REQUIRE(drive.gnss.size() == 20);
  CHECK(drive.gnss[1].t_us == kFirst_us + 100000);
  CHECK(drive.gnss[1].velocity->enu.x() == Approx(std::sqrt(200.0)));
  CHECK(drive.gnss[1].antenna.latitude == Approx(37.5 * kDegree));
  REQUIRE(drive.wheels.size() == 100);
  CHECK(drive.wheels[7].num_speeds == 4);
  CHECK(drive.wheels[7].speeds[1] == 20.2);
  REQUIRE(drive.reference.size() == kFrames);
  const ReferencePoint& point = drive.reference[10];
  CHECK(point.t_us == kFirst_us + 500000);
  CHECK(point.position.height == Approx(30.0).margin(0.01));
  CHECK((*point.velocity_enu - std::sqrt(200.0) * Eigen::Vector3d(1, 1, 0)).norm() < 1e-3);
  CHECK(yaw_of(*point.q_enu_body) == Approx(kPi / 4.0).margin(1e-4));
  CHECK((*point.q_enu_body * Eigen::Vector3d::UnitZ()).z() > 0.999);
  CHECK_THAT(said(drive), Catch::Contains("no camera: there is no video.hevc"));
  CHECK_THAT(said(drive), Catch::Contains("left out: live_gnss_qcom"));
  CHECK_THAT(said(drive), !Catch::Contains("gravity"));  // specific force upwards, as a right IMU has it
}

TEST_CASE("comma2k19: fixes have the receiver's times where it tells them, and rows may come in any order") {
  const test::TemporaryFolder folder;
  write_segment(folder / "s");
  CHECK_THAT(said(read(folder / "s")), Catch::Contains("gnss is live_gnss_ublox, at the time of its arrival"));
  Rows rows;
  for (int i = 0; i < 20; ++i) {
    rows.push_back({37.5, -122.2, 20.0 + i, static_cast<double>(kFirst_us / 1000) + 100.0 * i - 80.0, 30.0, 0.0});
  }
  Rows t = times(20, 0.1);
  std::swap(t[4], t[5]);
  std::swap(rows[4], rows[5]);
  test::write_file(folder / "s/processed_log/GNSS/live_gnss_ublox/value", npy(rows));
  test::write_file(folder / "s/processed_log/GNSS/live_gnss_ublox/t", npy(t));
  const Drive drive = read(folder / "s");
  REQUIRE(drive.gnss.size() == 20);
  for (int i = 0; i < 20; ++i) {
    const GnssFix& fix = drive.gnss[static_cast<std::size_t>(i)];
    CHECK(fix.t_us == kFirst_us + 100'000 * int64_t{i} - 80'000);  // 80 ms before it arrived
    CHECK(fix.velocity->enu.y() == Approx(20.0 + i));
  }
  CHECK_THAT(said(drive), Catch::Contains("at the receiver's own times"));
}

TEST_CASE("comma2k19: the film becomes pictures at the frames' times") {
  const test::TemporaryFolder folder;
  write_segment(folder / "s");
  if (!write_film(folder / "s/video.hevc", kFrames)) {
    WARN("skipped: OpenCV here cannot write HEVC");
    return;
  }
  const Drive drive = read(folder / "s");
  REQUIRE(drive.frames_left.size() == kFrames);
  CHECK(drive.frames_left[2].t_us == kFirst_us + 100000);
  const auto& camera = *drive.description.calibration.sensors.camera_left;
  CHECK(camera.width_px == 192);
  CHECK(camera.intrinsics_px->x() == Approx(910.0 * 192.0 / 1164.0));
  // A point ahead of the car is in the middle of the picture, one to the left is left of it.
  CHECK(
      (camera.mounting->T_body_camera().inverse() * Eigen::Vector3d(10.0, 1.0, 0.0) - Eigen::Vector3d(-1.0, 0.0, 10.0))
          .norm() < 1e-9);
  for (const std::size_t i : {std::size_t{30}, std::size_t{4}}) {  // back as well as on
    const std::vector<uint8_t> jpeg = drive.frames_left[i].store->read(drive.frames_left[i].index);
    CHECK(read_image_header(jpeg)->width_px == 192);
    const cv::Scalar mean = cv::mean(cv::imdecode(jpeg, cv::IMREAD_COLOR));
    CHECK(std::abs(mean[0] - 5.0 * static_cast<double>(i)) < 8.0);
  }
  fs::remove(folder / "s/video.hevc");
  REQUIRE(write_film(folder / "s/video.hevc", kFrames - 5));
  CHECK_THROWS_WITH(read(folder / "s"), Catch::Contains("video.hevc: has 35 pictures, global_pose/frame_times has 40"));
  test::write_file(folder / "s/video.hevc", "no film");
  CHECK_THAT(said(read(folder / "s")), Catch::Contains("left out: video.hevc: OpenCV here cannot decode it"));
}

TEST_CASE("comma2k19: rows that do not count are left out, and told") {
  const test::TemporaryFolder folder;
  write_segment(folder / "s");
  const fs::path gnss = folder / "s/processed_log/GNSS/live_gnss_ublox";
  Rows rows(20, {37.5, -122.2, 20.0, 0.0, 30.0, 45.0});
  rows[3] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
  rows[5][2] = std::nan("");
  test::write_file(gnss / "value", npy(rows));
  Rows t = times(20, 0.1);
  t[9] = t[8];
  test::write_file(gnss / "t", npy(t));
  const Drive drive = read(folder / "s");
  CHECK(drive.gnss.size() == 17);
  CHECK_THAT(said(drive), Catch::Contains("live_gnss_ublox: 2 of 20 rows left out"));
  CHECK_THAT(said(drive), Catch::Contains("live_gnss_ublox: 1 rows without a place left out"));
}

std::string error_of(const fs::path& segment) {
  try {
    read(segment);
  } catch (const ConfigError& e) {
    return e.what();
  }
  return "no error";
}

TEST_CASE("comma2k19: what is broken is told with its file") {
  struct Break {
    const char* file;
    std::string bytes;
    const char* error;
  };
  const std::string good = npy(times(40, 0.05));
  const std::vector<Break> breaks = {
      {"processed_log/IMU/gyro/value", "", "gyro/value: at offset 0: the array's signature needs 6 bytes, 0 are left"},
      {"processed_log/IMU/gyro/value", npy(Rows(200, {1.0, 2.0})), "gyro/value: has 2 columns, must have 3"},
      {"processed_log/IMU/gyro/value", npy(Rows(150, {1.0, 2.0, 3.0})), "gyro/value: has 150 rows"},
      {"processed_log/IMU/gyro/value", npy(Rows(200, {1.0, 2.0, 300.0})),
       "gyro/value: row 0: 1, 2, 300: must be within"},
      {"processed_log/IMU/gyro/t", npy(Rows(200, {-1.0})), "gyro/t: row 0: -1 s: must be seconds since the start"},
      {"processed_log/CAN/wheel_speed/value", npy(Rows(100, {1, 1, 1, 999})), "row 0: 999 m/s: must be within"},
      {"global_pose/frame_positions", npy(Rows(40, {1, 2, 3})), "frame_positions: row 0: is no place on the Earth"},
      {"global_pose/frame_orientations", npy(Rows(40, {1, 1, 0, 0})), "frame_orientations: row 0: the quaternion"},
      {"global_pose/frame_orientations", npy(Rows(39, {1, 0, 0, 0})), "frame_orientations: has 39 rows, frame_times"},
      {"global_pose/frame_gps_times", npy(Rows(40, {-1, 0})), "frame_gps_times: row 0: -1, 0: must be a GPS week"},
      {"global_pose/frame_times", npy(Rows(40, {5.0})), "frame_times: row 1: time runs backwards"},
      {"global_pose/frame_times", good.substr(0, good.size() - 3), "the numbers needs 320 bytes, 317 are left"},
      {"global_pose/frame_times", good + "x", "1 bytes behind the numbers"},
  };
  for (const Break& one : breaks) {
    const test::TemporaryFolder folder;
    write_segment(folder / "s");
    test::write_file(folder / "s" / one.file, one.bytes);
    INFO(one.file);
    CHECK_THAT(error_of(folder / "s"), Catch::Contains(one.error));
  }
}

NpyArray parse(const std::string& bytes) {
  return parse_npy(std::span(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()), "a.npy");
}

TEST_CASE("arrays of numpy: types, orders and shapes") {
  CHECK(parse(npy<float>("<f4", "(2, 3)", {1, 2, 3, 4, 5, 6})).at(1, 0) == 4.0);
  CHECK(parse(npy<double>("<f8", "(2, 3)", {1, 2, 3, 4, 5, 6}, "True")).at(1, 0) == 2.0);
  CHECK(parse(npy<int64_t>("<i8", "(2,)", {-7, 9})).at(0) == -7.0);
  CHECK(parse(npy<uint16_t>("<u2", "(1, 2)", {65535, 9})).at(0) == 65535.0);
  CHECK(parse(npy<double>("<f8", "(0, 3)", {})).rows == 0);
  CHECK_THROWS_WITH(parse(npy<double>(">f8", "(1,)", {1})), Catch::Contains("elements of type '>f8' are not read"));
  CHECK_THROWS_WITH(parse(npy<double>("<f8", "()", {1})), Catch::Contains("has 0 dimensions"));
  CHECK_THROWS_WITH(parse(npy<double>("<f8", "(1, 1, 1)", {1})), Catch::Contains("has 3 dimensions"));
  CHECK_THROWS_WITH(parse(npy<double>("<f8", "(134217728, 134217728)", {1})), Catch::Contains("more than 134217728"));
  CHECK_THROWS_WITH(parse(npy<double>("<f8", "(x)", {1})), Catch::Contains("shape must be of numbers"));
  CHECK_THROWS_WITH(parse("PK and so on, a zip"), Catch::Contains("is no array of numpy.save"));
}

TEST_CASE("an array that is cut anywhere is an error with file and offset") {
  const std::string whole = npy(Rows(3, {1.0, 2.0}));
  CHECK(parse(whole).rows == 3);
  for (std::size_t n = 0; n < whole.size(); ++n) {
    CHECK_THROWS_WITH(parse(whole.substr(0, n)), Catch::StartsWith("a.npy: at offset "));
  }
}

TEST_CASE("comma2k19: files that are cut anywhere are refused, and leave nothing") {
  const test::TemporaryFolder folder;
  write_segment(folder / "s");
  fs::remove_all(folder / "s/processed_log/GNSS/live_gnss_qcom");  // is not read beside the other receiver
  const test::Cuts cuts = test::cut_every_file(folder.path(), folder / "s");
  INFO(fmt::format("{} taken\n{}", cuts.taken, fmt::join(cuts.complaints, "\n")));
  CHECK(cuts.complaints.empty());
  CHECK(cuts.taken == 0);
}

}  // namespace
}  // namespace roadfix
