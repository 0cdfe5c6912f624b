// V4L2 cameras, video files and picture files, through OpenCV.
#include <fmt/format.h>

#include <cstdlib>
#include <filesystem>
#include <opencv2/videoio.hpp>
#include <thread>

#include "drivers/camera_driver/handler.h"
#include "drivers/camera_driver/pnm.h"
#include "drivers/device/threaded_source.h"

namespace roadfix {

namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr double kFileRate_hz = 10.0;  // of picture files, which say none
/// A camera that gives no picture for so many reads in a row is gone.
constexpr int kMaxMisses = 3;
/// OpenCV would wait ten seconds for each of them; it reads this from the environment, in whole seconds.
constexpr const char* kSelectTimeout_s = "1";

bool is_device(const std::string& name) { return name.starts_with("/dev/"); }

std::string open_failure(const std::string& name) {
  if (!is_device(name)) return ": no video or picture file that can be opened";
  return std::filesystem::exists(name) ? ": no camera that can be opened; does another program use it?"
                                       : ": no camera is plugged in there (ls /dev/video*)";
}

cv::VideoCapture open_one(const std::string& name, const CameraDriverConfig& config) {
  cv::VideoCapture capture;
  capture.setExceptionMode(false);
  if (!capture.open(name, is_device(name) ? cv::CAP_V4L2 : cv::CAP_ANY)) {
    throw SourceError(name + open_failure(name));
  }
  if (!is_device(name)) return capture;
  const auto ask = [&](int property, double value) {
    if (value > 0.0) capture.set(property, value);
  };
  if (config.fourcc.size() == 4) {
    const std::string& f = config.fourcc;
    capture.set(cv::CAP_PROP_FOURCC, cv::VideoWriter::fourcc(f[0], f[1], f[2], f[3]));
  }
  ask(cv::CAP_PROP_FRAME_WIDTH, config.width_px);
  ask(cv::CAP_PROP_FRAME_HEIGHT, config.height_px);
  ask(cv::CAP_PROP_FPS, config.rate);
  capture.set(cv::CAP_PROP_BUFFERSIZE, 1);                                // the newest picture, not the oldest of four
  if (config.fourcc == "MJPG") capture.set(cv::CAP_PROP_CONVERT_RGB, 0);  // the JPEG as the camera sent it
  return capture;
}

class CameraSource : public ByteSource {
 public:
  CameraSource(const CameraDriverConfig& config, std::function<int64_t()> now_utime)
      : config_(config), now_utime_(std::move(now_utime)), due_(SteadyClock::now()) {
    for (const std::string& device : config.devices) captures_.push_back(open_one(device, config));
    double rate = config.rate;
    if (rate <= 0.0) rate = captures_.front().get(cv::CAP_PROP_FPS);
    if (!(rate > 0.0 && rate < 1000.0)) rate = kFileRate_hz;
    period_ = std::chrono::duration_cast<SteadyClock::duration>(std::chrono::duration<double>(1.0 / rate));
  }

  ReadState read(std::chrono::milliseconds timeout, std::vector<Packet>& packets) override {
    const bool live = is_device(config_.devices.front());
    if (!live && due_ > SteadyClock::now() + timeout) {
      std::this_thread::sleep_for(timeout);
      return ReadState::kNothing;
    }
    if (!live) std::this_thread::sleep_until(due_);
    due_ += period_;
    std::vector<int64_t> stamps;
    for (cv::VideoCapture& capture : captures_) {
      if (!capture.grab()) return live && ++misses_ < kMaxMisses ? ReadState::kNothing : over(live);
      stamps.push_back(now_utime_());
    }
    misses_ = 0;
    cv::Mat picture;
    for (std::size_t i = 0; i < captures_.size(); ++i) {
      if (!captures_[i].retrieve(picture) || picture.empty()) return ReadState::kNothing;
      packets.push_back({static_cast<int>(i), config_.synchronised ? stamps.front() : stamps[i], bytes_of(picture)});
    }
    return ReadState::kData;
  }
  [[nodiscard]] std::string name() const override { return config_.devices.front(); }

 private:
  static ReadState over(bool live) { return live ? ReadState::kLost : ReadState::kEnd; }

  /// An unconverted MJPG picture is a row of bytes.
  static std::vector<uint8_t> bytes_of(const cv::Mat& picture) {
    if (picture.rows == 1 && picture.type() == CV_8UC1) return {picture.data, picture.data + picture.total()};
    return write_pnm(picture);
  }

  CameraDriverConfig config_;
  std::function<int64_t()> now_utime_;
  std::vector<cv::VideoCapture> captures_;
  SteadyClock::time_point due_;
  SteadyClock::duration period_{};
  int misses_ = 0;
};

}  // namespace

std::unique_ptr<ByteSource> open_cameras(const CameraDriverConfig& config, const std::function<int64_t()>& now_utime) {
  if (!is_device(config.devices.front())) return std::make_unique<CameraSource>(config, now_utime);
  ::setenv("OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT", kSelectTimeout_s, 0);
  const auto open = [&](const ThreadedSource::Now& now) { return std::make_unique<CameraSource>(config, now); };
  return std::make_unique<ThreadedSource>(open, now_utime);
}

}  // namespace roadfix
