#include <algorithm>

#include "config/calibration.h"
#include "config/config.h"
#include "monitor/monitor_config.h"
#include "roadfix/supervise/supervisor.h"

namespace roadfix {

namespace {

void expect(Expectations& expectations, const ExpectedChannel& channel) {
  const auto same = std::find_if(expectations.channels.begin(), expectations.channels.end(),
                                 [&](const ExpectedChannel& other) { return other.name == channel.name; });
  if (same == expectations.channels.end()) {
    expectations.channels.push_back(channel);
  } else {
    *same = channel;
  }
}

void expect_sensors(Expectations& expectations, const SensorsCalibration& sensors) {
  const auto sensor = [&](const char* channel, const auto& calibration) {
    if (calibration && calibration->rate) expect(expectations, {channel, calibration->rate});
  };
  sensor("IMU", sensors.imu);
  sensor("GNSS", sensors.gnss);
  sensor("WHEELS", sensors.wheels);
  sensor("CAMERA_LEFT", sensors.camera_left);
  sensor("CAMERA_RIGHT", sensors.camera_right);
}

}  // namespace

Expectations expectations_of(const MonitorConfig& config, const std::filesystem::path& vehicle) {
  Expectations expectations;
  expectations.judged_poses = config.judged_poses;
  if (!vehicle.empty() && std::filesystem::exists(vehicle / "calibration.yaml")) {
    expect_sensors(expectations, load_calibration(vehicle).sensors);
  }
  if (!vehicle.empty() && std::filesystem::exists(vehicle / "run.yaml")) {
    for (const SupervisedProcess& process : load_config<RunConfig>(vehicle / "run.yaml").processes) {
      if (!process.plain && process.name != "monitor") expectations.processes.push_back(process.name);
    }
  }
  for (const ExpectedChannel& channel : config.channels) expect(expectations, channel);
  return expectations;
}

}  // namespace roadfix
