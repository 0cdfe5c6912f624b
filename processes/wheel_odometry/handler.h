/// POSE_WHEEL from WHEELS, IMU and MAG: translates between messages and lib/wheel.
#pragma once

#include <filesystem>
#include <memory>

#include "bus/stage.h"
#include "config/calibration.h"
#include "wheel/wheel_odometry.h"

namespace roadfix {

/// configs/VEHICLE/wheel_odometry.yaml.
struct WheelOdometryConfig {
  double publish_period = 0.02;  ///< s, of data time
  WheelTuning odometry;
};

template <class Visitor>
void visit(WheelOdometryConfig& c, Visitor& v) {
  v.number("publish_period_s", c.publish_period, 0.0, 10.0);
  v.group("odometry", c.odometry);
}

/// What a calibration says about the sensors; what it leaves open keeps the defaults.
WheelSensors wheel_sensors(const Calibration& calibration);

std::unique_ptr<Stage> make_wheel_odometry(const Calibration& calibration, const WheelOdometryConfig& config);
std::unique_ptr<Stage> make_wheel_odometry(const std::filesystem::path& vehicle_dir);

}  // namespace roadfix
