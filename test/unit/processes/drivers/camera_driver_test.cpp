#include <catch2/catch.hpp>
#include <iostream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <roadfix/image_t.hpp>

#include "drivers/camera_driver/handler.h"
#include "drivers/camera_driver/pnm.h"
#include "support/driver_bench.h"

namespace roadfix {
namespace {

using test::Bench;
using test::Bytes;
using test::Published;
using test::replayed;
using test::sensor_messages;

TEST_CASE("pictures from files: JPEG out, the same again from the raw ones, one stamp for a pair") {
  const test::TemporaryFolder folder;
  for (int i = 0; i < 6; ++i) {
    cv::Mat picture(48, 64, CV_8UC3, cv::Scalar(20 * i, 100, 200 - 10 * i));
    REQUIRE(cv::imwrite((folder / ("frame_" + std::to_string(i) + ".png")).string(), picture));
  }
  CameraDriverConfig config;
  const std::string pattern = (folder / "frame_%d.png").string();
  config.devices = {pattern, pattern};
  config.synchronised = true;
  config.rate = 100.0;
  config.publish_raw = true;
  Bench bench(camera_driver_setup(config));
  REQUIRE(bench.step_until([&] { return !bench.more; }));
  CHECK(bench.count("CAMERA_LEFT") == 6);
  CHECK(bench.count("CAMERA_RIGHT") == 6);
  CHECK(bench.count("RAW_CAMERA_LEFT") == 7);  // with the opening
  const std::vector<Published> live = sensor_messages(bench);
  CHECK(replayed(bench) == live);
  const image_t left = decode<image_t>(live[0].bytes), right = decode<image_t>(live[1].bytes);
  CHECK(left.utime == right.utime);
  CHECK(left.width_px == 64);
  CHECK(left.format == image_t::FORMAT_JPEG);
}

TEST_CASE("a video file is played at its own rate, and ends the driver") {
  const test::TemporaryFolder folder;
  const std::string path = (folder / "drive.avi").string();
  constexpr int kPictures = 4;
  constexpr double kRate_hz = 4.0;  // slower than what is taken where a file says none
  {
    cv::VideoWriter video(path, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), kRate_hz, cv::Size(64, 48));
    REQUIRE(video.isOpened());
    for (int i = 0; i < kPictures; ++i) video.write(cv::Mat(48, 64, CV_8UC3, cv::Scalar(20 * i, 100, 200 - 10 * i)));
  }
  CameraDriverConfig config;
  config.devices = {path};
  config.publish_raw = true;
  const auto begin = std::chrono::steady_clock::now();
  Bench bench(camera_driver_setup(config));
  REQUIRE(bench.step_until([&] { return !bench.more; }));
  // A busy machine makes it longer, never shorter; between two stamps it may do either.
  CHECK(std::chrono::steady_clock::now() - begin >= std::chrono::duration<double>((kPictures - 1) / kRate_hz));
  REQUIRE(bench.count("CAMERA_LEFT") == kPictures);
  const std::vector<Published> live = sensor_messages(bench);
  CHECK(replayed(bench) == live);
  const image_t first = decode<image_t>(live.front().bytes), last = decode<image_t>(live.back().bytes);
  CHECK(first.width_px == 64);
  CHECK(last.utime > first.utime);
  const cv::Mat shown = cv::imdecode(last.data, cv::IMREAD_COLOR);
  CHECK(cv::norm(cv::mean(shown) - cv::Scalar(20 * (kPictures - 1), 100, 200 - 10 * (kPictures - 1))) < 5.0);
}

TEST_CASE("a camera that is not plugged in, and a device that is none, are told in plain words") {
  for (const auto& [device, words] :
       {std::pair("/dev/video_roadfix_none", "no camera is plugged in there"),
        std::pair("/dev/null", "no camera that can be opened; does another program use it?"),
        std::pair("/nowhere/drive.avi", "no video or picture file that can be opened")}) {
    CameraDriverConfig config;
    config.devices = {device};
    Bench bench(camera_driver_setup(config));
    REQUIRE(bench.step_until([&] { return bench.driver().state_reason().find(words) != std::string::npos; }));
    CHECK(bench.driver().state_reason().starts_with(device));
    CHECK(bench.count("CAMERA_LEFT") == 0);
  }
}

TEST_CASE("V4L2: a camera that is there gives pictures") {
  if (!std::filesystem::exists("/dev/video0")) {
    std::cout << "skipped: no /dev/video0\n";
    return;
  }
  CameraDriverConfig config;
  config.devices = {"/dev/video0"};
  Bench bench(camera_driver_setup(config));
  REQUIRE(bench.step_until([&] { return bench.count("CAMERA_LEFT") > 2; }));
}

TEST_CASE("pictures as bytes: PNM there and back, sizes of JPEG, and garbage") {
  cv::Mat colour(5, 7, CV_8UC3);
  for (int i = 0; i < 105; ++i) colour.data[i] = static_cast<uint8_t>(i * 37);
  const cv::Mat gray = cv::Mat(5, 7, CV_8UC1, colour.data).clone();
  for (const cv::Mat& picture : {colour, gray}) {
    const Bytes bytes = write_pnm(picture);
    const cv::Mat back = read_pnm(bytes);
    REQUIRE(back.size() == picture.size());
    REQUIRE(back.type() == picture.type());
    CHECK(cv::norm(back, picture, cv::NORM_INF) == 0.0);
    for (std::size_t n = 0; n < bytes.size(); ++n) CHECK(read_pnm({bytes.data(), n}).empty());
  }
  for (const std::string text : {"P6\n-1 5\n255\n", "P6\n99999 99999\n255\n", "P5\n1 1\n65535\nx", "P5\n"})
    CHECK(read_pnm(test::bytes_of(text)).empty());
  Bytes jpeg;
  REQUIRE(cv::imencode(".jpg", colour, jpeg));
  CHECK(read_jpeg_size(jpeg) == cv::Size(7, 5));
  for (std::size_t n = 0; n < 40; ++n) static_cast<void>(read_jpeg_size({jpeg.data(), n}));
}

}  // namespace
}  // namespace roadfix
