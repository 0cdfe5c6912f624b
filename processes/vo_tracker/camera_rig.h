/// The cameras of lib/slam from a calibration.
#pragma once

#include "config/calibration.h"
#include "slam/config.h"

namespace roadfix {

/// Throws std::runtime_error naming the missing key: intrinsics and extrinsics are required.
CameraRig camera_rig(const Calibration& calibration);

/// With focal_std and radial_std of the left camera's calibration, where it has them, in place of the configuration's.
KeyframeTrackerConfig with_lens_of(const Calibration& calibration, KeyframeTrackerConfig config);

}  // namespace roadfix
