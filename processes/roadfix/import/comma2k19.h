/// comma2k19 (Schafer et al. 2018), one segment: processed_log/{IMU,CAN,GNSS}/NAME/{t,value} and global_pose/frame_* as
/// numpy arrays, video.hevc. Axes there are x forward, y right, z down, times are seconds since the device's start; here
/// they become forward, left, up and UTC by global_pose's GPS times.
#pragma once

#include <filesystem>

#include "roadfix/import/drive.h"

namespace roadfix {

/// The body is the phone: its IMU, and the camera that the poses are of, are centimetres apart.
Drive read_comma2k19(const std::filesystem::path& segment);

}  // namespace roadfix
