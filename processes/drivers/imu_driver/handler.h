/// IMU and GNSS from an SBG Ellipse: the bytes of RAW_IMU to imu_t, and where they are asked for to gnss_t and to the
/// Ellipse's own solution as a pose_t.
#pragma once

#include <filesystem>
#include <map>

#include "drivers/device/driver.h"
#include "drivers/gnss_driver/gnss_epochs.h"
#include "drivers/protocols/device_clock.h"
#include "drivers/protocols/framer.h"
#include "drivers/protocols/sbg.h"
#include "geodesy/enu_anchor.h"

namespace roadfix {

struct ImuDriverConfig {
  DeviceConfig device;
  std::string channel = "IMU";
  std::string gnss_channel;           ///< of GPS1_POS, GPS1_VEL, GPS1_HDT; empty: another driver publishes GNSS
  std::string solution_channel;       ///< of EKF_NAV with EKF_QUAT, for example REFERENCE; empty: not published
  double latency = 0.0;               ///< s, from the end of the sample to its first byte
  double baseline_heading_deg = 0.0;  ///< direction from the first to the second antenna, clockwise from x forward
};

template <class Visitor>
void visit(ImuDriverConfig& c, Visitor& v) {
  visit(c.device, v);
  v.text("channel", c.channel);
  v.text("gnss_channel", c.gnss_channel);
  v.text("solution_channel", c.solution_channel);
  v.number("latency_s", c.latency, 0.0, 1.0);
  v.number("baseline_heading_deg", c.baseline_heading_deg, -360.0, 360.0);
}

class ImuDriver : public SensorDriver {
 public:
  explicit ImuDriver(const ImuDriverConfig& config);

  void opened(int stream) override;
  void take(int stream, int64_t read_utime, std::span<const uint8_t> bytes, SensorOutputs& outputs) override;
  [[nodiscard]] std::vector<StreamCounters> counters() const override;
  /// Motion beyond the sensor's range: such samples are published (imu_t has no place to mark them), and reported here.
  [[nodiscard]] std::string state_reason(int64_t now_utime) const override;

 private:
  void take_imu(const SbgImuShort& imu, int64_t read_utime, SensorOutputs& outputs);
  void take_pos(const SbgGpsPos& pos, int64_t read_utime);
  void take_vel(const SbgGpsVel& vel, int64_t read_utime);
  void take_hdt(const SbgGpsHdt& hdt, int64_t read_utime);
  void take_nav(const SbgEkfNav& nav, int64_t read_utime, SensorOutputs& outputs);
  template <class Log>
  void use(const std::optional<Log>& log, void (ImuDriver::*with)(const Log&, int64_t), int64_t read_utime);
  [[nodiscard]] std::optional<int64_t> utime_of(uint32_t device_us, int64_t read_utime);
  void count(const std::string& channel, bool published, int64_t utime);

  ImuDriverConfig config_;
  Framer framer_;
  WrappingClock wraps_;
  DeviceClock clock_;
  GnssEpochs epochs_;
  std::optional<SbgEkfQuat> quat_;
  std::optional<EnuAnchor> anchor_;
  int64_t used_ = 0, refused_ = 0;
  int64_t clipped_ = 0, clipped_utime_ = 0;
  std::map<std::string, StreamCounters> published_;
};

/// VEHICLE/imu_driver.yaml; `device` replaces its device where it is not empty.
DriverSetup imu_driver_setup(const std::filesystem::path& vehicle_dir, const std::string& device);
DriverSetup imu_driver_setup(const ImuDriverConfig& config);

}  // namespace roadfix
