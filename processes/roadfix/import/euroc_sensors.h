/// sensor.yaml of EuRoC recordings, and what TUM VI has in its place.
#pragma once

#include <filesystem>

#include "config/calibration.h"

namespace roadfix {

/// A camera's sensor.yaml: lens and place. ConfigError for a model that we do not have.
CameraCalibration read_euroc_camera(const std::filesystem::path& path);

/// An IMU's sensor.yaml, and TUM VI's dso/imu_config.yaml: rate and white noise. Their random walks say how biases move,
/// not how large they are: those stay unknown.
ImuCalibration read_euroc_imu(const std::filesystem::path& path);
ImuCalibration read_tum_imu(const std::filesystem::path& path);

}  // namespace roadfix
