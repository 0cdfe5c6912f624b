/// The cameras of lib/slam from a calibration.
#pragma once

#include "config/calibration.h"
#include "slam/config.h"

namespace roadfix {

/// Throws std::runtime_error naming the missing key: intrinsics and extrinsics are required.
CameraRig camera_rig(const Calibration& calibration);

}  // namespace roadfix
