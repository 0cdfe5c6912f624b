// Pictures in the log: files that decode to what the camera gave, in order of arrival, with calibration and faults.
#include <catch2/catch.hpp>
#include <fstream>
#include <iterator>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <roadfix/image_t.hpp>

#include "bus/log/log_reader.h"
#include "bus/types/message.h"
#include "roadfix/simulate/simulated_log.h"
#include "simulation/scenarios.h"
#include "simulation/scene/film.h"
#include "stream/thread_pool.h"
#include "support/temporary_folder.h"

namespace roadfix {
namespace {

ScenarioConfig stereo(const std::string& fault = "") {
  ScenarioConfig config = scenario("city_loop");
  config.duration_s = 6.0;
  config.camera = with_size(config.camera, 160, 64);
  config.camera.layout = CameraLayout::kStereo;
  config.camera.rate_hz = 4.0;
  if (!fault.empty()) config.faults.push_back(parse_fault(fault));
  return config;
}

struct Received {
  std::int64_t arrival_us;
  image_t image;
};

std::map<std::string, std::vector<Received>> pictures_of(const ScenarioConfig& config, int threads = 2) {
  const test::TemporaryFolder folder;
  ThreadPool pool(threads);
  write_simulated_log(simulate(config, 5), folder / "drive.lcm", {pool});
  std::map<std::string, std::vector<Received>> out;
  LogReader reader(folder / "drive.lcm");
  while (const auto event = reader.next()) {
    if (event->channel.starts_with("CAMERA_"))
      out[std::string(event->channel)].push_back({event->timestamp_us, decode<image_t>(event->data)});
  }
  return out;
}

cv::Mat decoded(const image_t& m) { return cv::imdecode(m.data, cv::IMREAD_UNCHANGED); }

TEST_CASE("PNG pictures of the log are the film's, bit for bit, and JPEG ones are close") {
  ScenarioConfig config = stereo();
  const auto jpeg = pictures_of(config);
  config.camera.lossless = true;
  const auto png = pictures_of(config);
  const SimulatedDrive drive = simulate(config, 5);
  InlineExecutor executor;
  Film film(drive, executor);
  REQUIRE(png.at("CAMERA_LEFT").size() == 25);
  REQUIRE(png.at("CAMERA_RIGHT").size() == 25);
  REQUIRE(jpeg.at("CAMERA_LEFT").size() == 25);
  for (std::size_t i = 0; i < 25; ++i) {
    REQUIRE(film.advance());
    for (const CameraSide eye : {CameraSide::kLeft, CameraSide::kRight}) {
      const char* channel = eye == CameraSide::kLeft ? "CAMERA_LEFT" : "CAMERA_RIGHT";
      const image_t& exact = png.at(channel)[i].image;
      const GrayImage truth = film.picture(eye, {});
      CHECK(exact.utime == drive.exposures[i]);
      CHECK(exact.seq == static_cast<std::int64_t>(i));
      CHECK(exact.exposure_s == film.exposure().time_s);
      CHECK(exact.format == image_t::FORMAT_PNG);
      const cv::Mat pixels = decoded(exact);
      REQUIRE(pixels.cols == 160);
      REQUIRE(pixels.rows == 64);
      REQUIRE(pixels.isContinuous());
      CHECK(std::equal(truth.pixels.begin(), truth.pixels.end(), pixels.data));
      const image_t& lossy = jpeg.at(channel)[i].image;
      CHECK(lossy.format == image_t::FORMAT_JPEG);
      CHECK(lossy.size_bytes < exact.size_bytes);
      const double rms = cv::norm(decoded(lossy), pixels) / std::sqrt(160.0 * 64.0);
      CHECK(rms > 0.1);
      CHECK(rms < 6.0);
    }
  }
}

TEST_CASE("the log with pictures is the same bytes with one thread and with three") {
  const test::TemporaryFolder folder;
  const auto bytes = [&](int threads) {
    ThreadPool pool(threads);
    write_simulated_log(simulate(stereo("camera.delay@2+2:jitter_s=0.6"), 5), folder / "drive.lcm", {pool});
    std::ifstream file(folder / "drive.lcm", std::ios::binary);
    return std::string{std::istreambuf_iterator<char>(file), {}};
  };
  const std::string once = bytes(1);
  CHECK(once.size() > 50'000);
  CHECK(once == bytes(3));
}

TEST_CASE("faults of the camera's link show in the log and only there") {
  const auto before = pictures_of(stereo());
  SECTION("lost pictures leave gaps in seq") {
    const auto after = pictures_of(stereo("camera.drop@2+3:probability=0.5,right=0"));
    const auto& left = after.at("CAMERA_LEFT");
    CHECK(left.size() < 24);
    CHECK(left.back().image.seq == 24);
    CHECK(after.at("CAMERA_RIGHT").size() == 25);
    for (const Received& r : left) CHECK(r.image.data == before.at("CAMERA_LEFT")[size_t(r.image.seq)].image.data);
  }
  SECTION("a frozen camera repeats its last picture under new stamps") {
    const auto after = pictures_of(stereo("camera.stuck@2+2"));
    for (const auto& [channel, list] : after) {
      REQUIRE(list.size() == 25);
      for (std::size_t i = 0; i < 25; ++i) {
        const bool frozen = i >= 8 && i < 16;
        CHECK(list[i].image.utime == before.at(channel)[i].image.utime);
        CHECK(list[i].image.data == before.at(channel)[frozen ? 7 : i].image.data);
      }
    }
  }
  SECTION("late pictures arrive late and carry their own time") {
    const auto after = pictures_of(stereo("camera.delay@2+2:delay_s=0.5"));
    int late = 0;
    for (const Received& r : after.at("CAMERA_LEFT")) late += r.arrival_us - r.image.utime > 500'000 ? 1 : 0;
    CHECK(late == 8);
  }
}

TEST_CASE("damaged files are damaged in their time, most do not decode to the picture") {
  const auto before = pictures_of(stereo());
  const auto after = pictures_of(stereo("camera.corrupt@2+3:probability=1,right=0"));
  CHECK(after.at("CAMERA_RIGHT").size() == 25);
  for (std::size_t i = 0; i < 25; ++i) {
    const image_t& a = before.at("CAMERA_LEFT")[i].image;
    const image_t& b = after.at("CAMERA_LEFT")[i].image;
    CHECK(b.size_bytes == static_cast<std::int32_t>(b.data.size()));
    CHECK((a.data == b.data) == (i < 8 || i >= 20));
    CHECK(before.at("CAMERA_RIGHT")[i].image.data == after.at("CAMERA_RIGHT")[i].image.data);
    if (i < 8 || i >= 20) continue;
    const cv::Mat pixels = decoded(b);
    CHECK((pixels.empty() || cv::norm(pixels, decoded(a)) > 0.0));
  }
}

TEST_CASE("the calibration says where the cameras are, and a drive without them none") {
  ScenarioConfig config = stereo();
  config.imu.position_m = {0.8, 0.1, 0.4};
  config.imu.mounting_std_rad = {0.09, 0.09, 0.09};
  config.camera.distortion = {-0.2, 0.05, 1e-3, -1e-3};
  const SimulatedDrive drive = simulate(config, 1);
  REQUIRE(drive.errors.q_vehicle_imu.vec().norm() > 0.02);
  const Calibration c = parse_calibration(calibration_text(calibration_of(drive)), "calibration");
  const CameraCalibration& left = *c.sensors.camera_left;
  const SE3 T_body_left = left.mounting->T_body_camera();
  const SE3 T_vehicle_left = SE3{drive.errors.q_vehicle_imu, config.imu.position_m} * T_body_left;
  CHECK(local(T_vehicle_left, rig_of(drive).T_vehicle_left).norm() < 1e-12);
  CHECK((T_body_left.inverse() * c.sensors.camera_right->mounting->T_body_camera()).p.x() == Approx(0.54));
  CHECK(*left.intrinsics_px == config.camera.intrinsics_px);
  CHECK(left.distortion->coefficients == std::vector<double>{-0.2, 0.05, 1e-3, -1e-3});
  config.camera.layout = CameraLayout::kMono;
  CHECK_FALSE(calibration_of(simulate(config, 1)).sensors.camera_right);
  config.camera.layout = CameraLayout::kNone;
  CHECK_FALSE(calibration_of(simulate(config, 1)).sensors.camera_left);
}

}  // namespace
}  // namespace roadfix
