/// EuRoC MAV recordings: mav0 with imu0, cam0, cam1 and state_groundtruth_estimate0, each sensor.yaml and data.csv; and
/// TUM VI's: mocap0 in place of the ground truth, dso/camchain.yaml and dso/imu_config.yaml in place of sensor.yaml.
#pragma once

#include <filesystem>

#include "roadfix/import/drive.h"

namespace roadfix {

/// `folder` is mav0 or holds it. Stamps are nanoseconds and become microseconds, rounded down. The body is the IMU with
/// its own axes (EuRoC's x points up, so the mounting is unknown); the reference is in a local frame, z up.
Drive read_euroc(const std::filesystem::path& folder);

}  // namespace roadfix
