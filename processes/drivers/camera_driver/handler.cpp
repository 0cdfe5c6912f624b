#include "drivers/camera_driver/handler.h"

#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <roadfix/image_t.hpp>

#include "config/config.h"
#include "drivers/camera_driver/pnm.h"

namespace roadfix {

namespace {

constexpr uint8_t kJpegStart[] = {0xFF, 0xD8, 0xFF};

bool is_jpeg(std::span<const uint8_t> bytes) {
  return bytes.size() > sizeof kJpegStart && std::equal(std::begin(kJpegStart), std::end(kJpegStart), bytes.begin());
}

void set_data(std::vector<uint8_t> data, int8_t format, const cv::Size& size, image_t& message) {
  message.width_px = size.width;
  message.height_px = size.height;
  message.format = format;
  message.size_bytes = static_cast<int32_t>(data.size());
  message.data = std::move(data);
}

/// The picture in the form that the configuration asks for; false where it is none.
bool fill(std::span<const uint8_t> bytes, const CameraDriverConfig& config, image_t& message) {
  const std::optional<cv::Size> jpeg_size = is_jpeg(bytes) ? read_jpeg_size(bytes) : std::nullopt;
  if (jpeg_size && config.encoding == CameraEncoding::kJpeg && !config.gray) {
    set_data({bytes.begin(), bytes.end()}, image_t::FORMAT_JPEG, *jpeg_size, message);
    return true;
  }
  cv::Mat picture;
  if (jpeg_size) {
    const cv::Mat view(1, static_cast<int>(bytes.size()), CV_8UC1, const_cast<uint8_t*>(bytes.data()));
    picture = cv::imdecode(view, config.gray ? cv::IMREAD_GRAYSCALE : cv::IMREAD_COLOR);
  } else {
    picture = read_pnm(bytes);
  }
  if (picture.empty()) return false;
  if (config.gray && picture.channels() == 3) cv::cvtColor(picture, picture, cv::COLOR_BGR2GRAY);
  std::vector<uint8_t> data;
  switch (config.encoding) {
    case CameraEncoding::kJpeg:
      cv::imencode(".jpg", picture, data, {cv::IMWRITE_JPEG_QUALITY, config.jpeg_quality});
      set_data(std::move(data), image_t::FORMAT_JPEG, picture.size(), message);
      break;
    case CameraEncoding::kPng:
      cv::imencode(".png", picture, data);
      set_data(std::move(data), image_t::FORMAT_PNG, picture.size(), message);
      break;
    case CameraEncoding::kRaw:
      data.assign(picture.data, picture.data + picture.total() * picture.elemSize());
      set_data(std::move(data), picture.channels() == 1 ? image_t::FORMAT_GRAY8 : image_t::FORMAT_BGR8, picture.size(),
               message);
      break;
  }
  return true;
}

}  // namespace

CameraDriver::CameraDriver(const CameraDriverConfig& config) : config_(config) {
  for (std::size_t i = 0; i < config.devices.size(); ++i) {
    counters_.emplace_back().name = config.channels[i];
    CameraDriver::opened(static_cast<int>(i));
  }
}

void CameraDriver::opened(int stream) {
  const auto i = static_cast<std::size_t>(stream);
  const TimestampFilter fresh(config_.rate > 0.0 ? std::optional<double>(config_.rate) : std::nullopt);
  if (i < stamps_.size())
    stamps_[i] = fresh;
  else
    stamps_.push_back(fresh);
}

void CameraDriver::take(int stream, int64_t read_utime, std::span<const uint8_t> bytes, SensorOutputs& outputs) {
  const auto i = static_cast<std::size_t>(stream);
  StreamCounters& counters = counters_[i];
  ++counters.received;
  image_t message{};
  if (!fill(bytes, config_, message)) {
    ++counters.refused;
    return;
  }
  const int64_t arrived = config_.filter_stamps ? stamps_[i].filter(read_utime) : read_utime;
  message.utime = arrived - std::llround(config_.latency * 1e6);
  if (outputs.publish(config_.channels[i], message)) {
    ++counters.used;
    counters.newest_utime = message.utime;
  } else {
    ++counters.late;
  }
}

std::vector<StreamCounters> CameraDriver::counters() const { return counters_; }

DriverSetup camera_driver_setup(const CameraDriverConfig& config) {
  DriverSetup setup;
  setup.name = "camera_driver";
  for (std::size_t i = 0; i < config.devices.size(); ++i) setup.raw_channels.push_back("RAW_" + config.channels[i]);
  setup.publish_raw = config.publish_raw;
  setup.config = explained_config_text(config);
  setup.device.device = config.devices.front();
  setup.device.silence = config.silence;
  setup.device.reopen_first = config.reopen_first;
  setup.device.reopen_max = config.reopen_max;
  setup.make = [config] { return std::make_unique<CameraDriver>(config); };
  setup.open = [config](const std::function<int64_t()>& now_utime) { return open_cameras(config, now_utime); };
  return setup;
}

DriverSetup camera_driver_setup(const std::filesystem::path& vehicle_dir, const std::string& device) {
  auto config = load_config<CameraDriverConfig>(vehicle_dir / "camera_driver.yaml");
  if (!device.empty()) config.devices.front() = device;
  return camera_driver_setup(config);
}

}  // namespace roadfix
