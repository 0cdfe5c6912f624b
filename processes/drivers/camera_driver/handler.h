/// Cameras: what V4L2 or a video file gives to image_t. The raw form of a picture is a file's: JPEG as the camera sent
/// it, or binary PNM (P5 grey, P6 RGB), so that it explains itself.
#pragma once

#include <filesystem>

#include "camera/timestamp_filter.h"
#include "drivers/device/driver.h"

namespace roadfix {

enum class CameraEncoding { kJpeg, kPng, kRaw };

struct CameraDriverConfig {
  /// "/dev/video0", a video file, or a pattern of picture files ("frames/%06d.png"). One, or two of a stereo camera.
  std::vector<std::string> devices;
  std::vector<std::string> channels = {"CAMERA_LEFT", "CAMERA_RIGHT"};
  bool synchronised = false;  ///< two cameras with one trigger: the pair gets one stamp
  double rate = 0.0;          ///< Hz; 0: as the device likes; of a file: as it says
  int width_px = 0;           ///< 0: as the device likes
  int height_px = 0;
  std::string fourcc;  ///< for example MJPG or YUYV; empty: as the device likes
  bool gray = false;   ///< drop the colour
  CameraEncoding encoding = CameraEncoding::kJpeg;
  int jpeg_quality = 90;      ///< of pictures that did not come as JPEG
  double latency = 0.0;       ///< s, from the middle of the exposure to the picture's arrival
  bool filter_stamps = true;  ///< take the jitter of arrival out (camera/stamp_filter.h)
  bool publish_raw = false;   ///< RAW_CAMERA_* too: uncompressed pictures are 50 MB/s and more
  double silence = 3.0;       ///< s without a picture after which the heartbeat says so
  double reopen_first = 0.2;  ///< s
  double reopen_max = 5.0;    ///< s
};

template <class Visitor>
void visit(CameraDriverConfig& c, Visitor& v) {
  v.require("devices");
  v.texts("devices", c.devices);
  v.check("devices", c.devices.size() == 1 || c.devices.size() == 2, "must be one camera, or two");
  v.texts("channels", c.channels);
  v.check("channels", c.channels.size() >= c.devices.size(), "must be as many as devices");
  v.boolean("synchronised", c.synchronised);
  v.number("rate_hz", c.rate, 0.0, 1000.0);
  v.integer("width_px", c.width_px, 0, 16384);
  v.integer("height_px", c.height_px, 0, 16384);
  v.text("fourcc", c.fourcc);
  v.check("fourcc", c.fourcc.empty() || c.fourcc.size() == 4, "must be four letters");
  v.boolean("gray", c.gray);
  v.choice("encoding", c.encoding,
           {{"jpeg", CameraEncoding::kJpeg}, {"png", CameraEncoding::kPng}, {"raw", CameraEncoding::kRaw}});
  v.integer("jpeg_quality", c.jpeg_quality, 1, 100);
  v.number("latency_s", c.latency, 0.0, 1.0);
  v.boolean("filter_stamps", c.filter_stamps);
  v.boolean("publish_raw", c.publish_raw);
  v.number("silence_s", c.silence, 0.01, 3600.0);
  v.number("reopen_first_s", c.reopen_first, 0.001, 60.0);
  v.number("reopen_max_s", c.reopen_max, 0.001, 600.0);
}

class CameraDriver : public SensorDriver {
 public:
  explicit CameraDriver(const CameraDriverConfig& config);

  void opened(int stream) override;
  void take(int stream, int64_t read_utime, std::span<const uint8_t> bytes, SensorOutputs& outputs) override;
  [[nodiscard]] std::vector<StreamCounters> counters() const override;

 private:
  CameraDriverConfig config_;
  std::vector<TimestampFilter> stamps_;
  std::vector<StreamCounters> counters_;
};

/// Opens the cameras; packets are stamped when the pictures arrived, before they are copied. Throws SourceError.
std::unique_ptr<ByteSource> open_cameras(const CameraDriverConfig& config, const std::function<int64_t()>& now_utime);

/// VEHICLE/camera_driver.yaml; `device` replaces its first device where it is not empty.
DriverSetup camera_driver_setup(const std::filesystem::path& vehicle_dir, const std::string& device);
DriverSetup camera_driver_setup(const CameraDriverConfig& config);

}  // namespace roadfix
